"""The corpus: what synthesisers say, kept and read again; what may be missing says so."""

from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import TrainingError
from dubbing.speech.voice_activity import steps
from dubbing.workshop.training.speech import corpus, synthesis
from dubbing.workshop.training.speech.corpus import Amounts, load_part, save_part, training_voices
from dubbing.workshop.training.speech.texts import LANGUAGES, sentence
from tests.dubbing.workshop.training.speech.made import spoken, utterance

pytestmark = pytest.mark.medium


def test_an_utterance_covers_its_sound() -> None:
    made = utterance()
    count = steps(len(made.samples))
    assert made.samples.dtype == np.int16
    assert made.classes.shape == (count,)
    assert made.lips.shape == (count, 7)
    assert made.senones.shape == (count, 126)
    # "map" closes the lips: once for m, once for p.
    assert made.lips[:, 4].max() > 0.7
    assert 0.3 < (made.classes > 0).mean() < 1


def test_unknown_phones_are_marked() -> None:
    made = corpus.without_senones(synthesis.Spoken(spoken().samples, None))
    assert (made.classes == -1).all()
    assert np.isnan(made.lips).all()


def test_a_part_is_kept_exactly(tmp_path: Path) -> None:
    before = [utterance(), utterance()]
    save_part(tmp_path / "espeak-en.safetensors", before)
    after = load_part(tmp_path / "espeak-en.safetensors", real=False)
    assert (after.name, len(after.utterances)) == ("espeak-en", 2)
    for a, b in zip(before, after.utterances, strict=True):
        for name in ("samples", "classes", "lips", "senones"):
            assert np.array_equal(getattr(a, name), getattr(b, name))


def test_what_is_left_out_is_not_taught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(synthesis, "available", lambda voice: True)
    names = {(v.engine, v.name) for v, _ in training_voices(Amounts())}
    assert ("flite", "slt") in names
    assert ("flite", corpus.LEFT_OUT_VOICE) not in names
    assert ("espeak", corpus.LEFT_OUT_LANGUAGE) not in names
    assert len([e for e, _ in names if e == "espeak"]) >= 20


def test_without_flite_it_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(synthesis.shutil, "which", lambda name: None)
    with pytest.raises(TrainingError, match="flite"):
        training_voices(Amounts())


@pytest.mark.parametrize("language", ["cmn", "hi", "ru", "vi"])
def test_languages_are_spoken(language: str) -> None:
    rng = np.random.default_rng(1)
    message = synthesis.speak(synthesis.espeak_voice(language), sentence(language, rng, 4), rng)
    assert len(message.samples) > 8000
    assert message.phones is not None
    assert len(message.phones) > 5


def test_sentences_hold_known_words() -> None:
    text = sentence("de", np.random.default_rng(0), 9)
    words = text.rstrip(".").replace(",", "").split()
    assert len(words) == 9
    assert set(words) <= set(LANGUAGES["de"].split())


def test_the_teacher_tells_speech_from_silence() -> None:
    pytest.importorskip("pocketsphinx", reason="the teacher is not installed")
    from dubbing.workshop.training.speech.teacher import senone_posteriors

    samples = np.concatenate([np.zeros(16_000, np.float32), spoken().samples])
    found = senone_posteriors(samples)
    assert found.shape == (steps(len(samples)), 126)
    assert np.allclose(found.sum(1), 1, atol=1e-3)
    alike = np.sqrt(found[10:40].mean(0)) @ np.sqrt(found[55:75].mean(0))
    assert alike < 0.5


def test_a_long_sound_is_taught_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pocketsphinx", reason="the teacher is not installed")
    from dubbing.workshop.training.speech import teacher

    sound = spoken("a long line about the seven yellow moons over my home").samples
    whole = teacher.senone_posteriors(sound)
    monkeypatch.setattr(teacher, "PIECE_SECONDS", 1)
    parts = teacher.senone_posteriors(sound)
    assert parts.shape == whole.shape
    alike = (np.sqrt(whole) * np.sqrt(parts)).sum(1)
    assert alike.mean() > 0.8


def test_without_the_teacher_it_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.workshop.training.speech.teacher import senone_posteriors

    monkeypatch.setitem(__import__("sys").modules, "pocketsphinx", None)
    with pytest.raises(TrainingError, match="pocketsphinx"):
        senone_posteriors(np.zeros(1600, np.float32))
