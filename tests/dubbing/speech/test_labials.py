"""The p, b and m of words are found where they sound, by letters alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import resample_poly

from dubbing.speech.labials import in_phones, labials, letters_of, words_in
from dubbing.speech.phone_classes import CLASS_OF, CLASSES, SILENCE
from dubbing.speech.voice_activity import SAMPLE_RATE, STEP_RATE


def phones_of(said: str) -> np.ndarray:
    """Probabilities of a sound, a letter a step; a space is silence."""
    found = np.full((len(said), len(CLASSES)), 0.1 / len(CLASSES))
    for step, letter in enumerate(said):
        found[step, SILENCE if letter == " " else CLASS_OF[letter]] += 0.9
    return found


@pytest.mark.parametrize(
    ("words", "letters"),
    [
        ("Più pane, mamma!", " piu pane mama "),
        ("  a  photo ", " a foto "),
        ("Папа 3 раз", " p*p* * * "),
        ("日本", " * "),
        ("- -", " "),
    ],
)
def test_letters(words: str, letters: str) -> None:
    assert letters_of(words) == letters


@pytest.mark.parametrize(
    ("said", "words", "found"),
    [
        ("   aaappaa   ", "apa", [("p", 7)]),
        ("   bbbiinn   mmaa  ", "bin ma", [("b", 4.5), ("m", 14)]),
        # A labial that no letter asks for is none, and a letter that is not heard is left out.
        ("  aaabbaaattt  ", "at", []),
        ("  dauut   bbiii ", "doubt bi", [("b", 11)]),
        ("   ", "bib", []),
    ],
)
def test_each_is_where_it_is_heard(said: str, words: str, found: list[tuple[str, float]]) -> None:
    answer = in_phones(phones_of(said), letters_of(words))
    assert [one.letter for one in answer] == [letter for letter, _ in found]
    assert [STEP_RATE * one.at for one in answer] == pytest.approx([at for _, at in found], abs=0.5)


def test_words_without_a_labial_and_sounds_without_anything() -> None:
    assert labials(lambda: [np.zeros(SAMPLE_RATE, np.float32)], "nothing there") == []
    assert labials(lambda: [np.zeros(0, np.float32)], "pump") == []


@pytest.mark.medium
@pytest.mark.parametrize(
    ("voice", "words"),
    [
        ("en-us", "My mother made apple pie and plum jam before the match."),
        ("it", "Mia mamma prepara sempre la pasta al pomodoro."),
        ("de", "Der Mann am Pult probt ein paar bekannte Melodien."),
        ("ru", "Мама мыла раму, а папа пил пиво."),
    ],
)
def test_labials_of_known_speech_are_found(voice: str, words: str) -> None:
    from dubbing.workshop.synthetic.voice import synthesise

    samples, rate, phones = synthesise(words, voice)
    sound = resample_poly(samples, SAMPLE_RATE, rate).astype(np.float32)
    true = [(p.start, p.end) for p in phones if {*p.symbol} & {*"pbm"}]
    found = np.array([one.at for one in labials(lambda: [sound], words)])
    away = np.array([np.maximum(np.maximum(start - found, found - end), 0) for start, end in true])
    assert away.min(1).max() < 1 / STEP_RATE  # in each of them there is one, to a step
    assert away.min(0).max() < 0.04  # and nowhere else


@pytest.mark.medium
@pytest.mark.parametrize(
    ("voice", "words"),
    [
        ("en-us", "My mother made apple pie and plum jam before the match."),
        ("it", "Mia mamma - prepara sempre la pasta al pomodoro."),
    ],
)
def test_words_of_known_speech_are_found(voice: str, words: str) -> None:
    """True times are of sentences that grow by a word."""
    from dubbing.workshop.synthetic.voice import synthesise

    texts = [text for text in words.split() if text != "-"]
    counts = [0]
    for k in range(len(texts)):
        said = synthesise(" ".join(texts[: k + 1]), voice)[2]
        counts.append(sum(bool(phone.symbol.strip("_: ")) for phone in said))
    samples, rate, phones = synthesise(" ".join(texts), voice)
    spoken = [phone for phone in phones if phone.symbol.strip("_: ")]
    sound = resample_poly(samples, SAMPLE_RATE, rate).astype(np.float32)
    found = words_in(lambda: [sound], words)
    assert [word.text for word in found] == texts
    for word, first, stop in zip(found, counts, counts[1:], strict=False):
        assert word.start == pytest.approx(spoken[first].start, abs=0.08), word
        assert word.end == pytest.approx(spoken[stop - 1].end, abs=0.08), word
    assert words_in(lambda: [np.zeros(0, np.float32)], words) == []
    assert words_in(lambda: [sound], "- -") == []
