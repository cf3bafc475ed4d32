"""Speech: phones tile the sound, in order; the same call gives the same samples."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import soundfile

from dubbing.errors import ExplainedError
from dubbing.workshop.synthetic.__main__ import VOICES
from dubbing.workshop.synthetic.voice import speak, synthesise

pytestmark = pytest.mark.medium


def test_phones_are_ordered_and_cover_the_sound() -> None:
    samples, rate, phones = synthesise("My name is Bob. Papa maps.", "en-us")
    assert phones[0].start == 0.0
    assert phones[-1].end == pytest.approx(len(samples) / rate)
    for before, after in itertools.pairwise(phones):
        assert before.start < before.end == after.start
    symbols = "".join(p.symbol for p in phones)
    assert symbols.count("p") == 3
    assert symbols.count("m") == 3


def test_vowels_are_louder_than_pauses() -> None:
    samples, rate, phones = synthesise("Papa. Mama.", "en-us")

    def level(symbol: str) -> float:
        pieces = [
            samples[round(p.start * rate) : round(p.end * rate)]
            for p in phones
            if (symbol in p.symbol if symbol else not p.symbol)
        ]
        return float(np.sqrt(np.mean(np.concatenate(pieces) ** 2)))

    assert level("ɑ") > 10 * level("")


@pytest.mark.parametrize("voice", ["en-us", "it+f3", "de+f2"])
def test_the_same_call_gives_the_same_sound(voice: str) -> None:
    first = synthesise("Buongiorno.", voice)
    synthesise("Something else in between.", "en-us+m3")
    second = synthesise("Buongiorno.", voice)
    np.testing.assert_array_equal(first[0], second[0])
    assert first[2] == second[2]


def test_wav_file_holds_the_speech(tmp_path: Path) -> None:
    phones = speak("Guten Abend.", "de", tmp_path / "a.wav")
    samples, rate = soundfile.read(tmp_path / "a.wav")
    assert len(samples) / rate == pytest.approx(phones[-1].end)
    assert np.abs(samples).max() > 0.1


def test_unknown_voice_and_empty_text() -> None:
    with pytest.raises(ExplainedError, match="no voice 'klingonish'"):
        synthesise("Hello", "klingonish")
    with pytest.raises(ExplainedError, match="no words in"):
        synthesise("  ", "en-us")


def test_every_voice_of_the_many_identities_is_there() -> None:
    for voice in VOICES:
        samples, _, _ = synthesise("Yes.", voice)
        assert np.abs(samples).max() > 0.01
