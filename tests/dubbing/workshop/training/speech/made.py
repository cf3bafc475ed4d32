"""A little corpus from espeak-ng, with a teacher that always says the same."""

from functools import lru_cache

import numpy as np

from dubbing.speech.voice_activity import SAMPLE_RATE, steps
from dubbing.workshop.synthetic.visemes import Phone
from dubbing.workshop.training.speech import corpus, synthesis
from dubbing.workshop.training.speech.corpus import Part, Utterance
from dubbing.workshop.training.speech.teacher import SENONES


def posteriors(samples: np.ndarray) -> np.ndarray:
    """In the place of the teacher: (T, S), one senone for even steps, another for odd ones."""
    found = np.zeros((steps(len(samples)), SENONES), np.float32)
    found[::2, 5] = 1
    found[1::2, 9] = 1
    return found


@lru_cache
def spoken(text: str = "a map of seven moons") -> synthesis.Spoken:
    return synthesis.speak(synthesis.espeak_voice("en-us"), text, np.random.default_rng(0))


def utterance() -> Utterance:
    message = spoken()
    assert message.phones is not None
    # Half a second of pause behind it.
    end = len(message.samples) / SAMPLE_RATE
    phones = [*message.phones, Phone("", end, end + 0.5)]
    samples = np.pad(message.samples, (0, SAMPLE_RATE // 2))
    made = corpus.without_senones(synthesis.Spoken(samples, phones))
    return Utterance(made.samples, made.classes, made.lips, posteriors(samples))


def parts() -> list[Part]:
    """One synthetic voice, and one recording whose phones nobody knows."""
    known = utterance()
    unknown = Utterance(
        known.samples[::-1].copy(),
        np.full_like(known.classes, -1),
        np.full_like(known.lips, np.nan),
        known.senones,
    )
    return [Part("espeak-en-us", False, [known]), Part("real-someone", True, [unknown])]
