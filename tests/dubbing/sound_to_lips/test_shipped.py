"""The shipped network: predicted lips follow what is spoken, and not other speech.

The lips of the synthetic speaker are known exactly; the network learned from people on film only.
"""

from fractions import Fraction
from functools import lru_cache

import numpy as np
import pytest
from scipy.signal import resample_poly

from dfrf.field.speaker_adaptation import OPENING, TOUCHING
from dubbing.sound_to_lips.predict import predict
from dubbing.speech.voice_activity import SAMPLE_RATE, STEP_RATE
from dubbing.workshop.synthetic.visemes import CHANNELS, mouth_curves
from dubbing.workshop.synthetic.voice import synthesise

TEXTS = {
    "en-us": "My brother bought a map of the moon, and papa put it above the warm bed by the pond.",
    "de": "Am Abend bringt mein Bruder immer Brot und Butter vom Bäcker, und Mama macht Tee.",
}


@lru_cache
def opening(voice: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Predicted opening, score of touching lips, and the jaw's true opening, (T,) each."""
    samples, rate, phones = synthesise(TEXTS[voice], voice)
    divisor = int(np.gcd(rate, SAMPLE_RATE))
    sound = resample_poly(samples, SAMPLE_RATE // divisor, rate // divisor).astype(np.float32)
    found = predict(lambda: [sound])
    truth = mouth_curves(phones, len(found), Fraction(STEP_RATE))
    return found[:, OPENING], found[:, TOUCHING], truth[:, CHANNELS.index("jaw")]


@pytest.mark.parametrize("voice", list(TEXTS))
def test_the_predicted_opening_follows_the_true_mouth(voice: str) -> None:
    predicted, closed, truth = opening(voice)
    assert np.corrcoef(predicted, truth)[0, 1] > 0.5
    assert np.corrcoef(closed, truth)[0, 1] < -0.3


def test_the_opening_of_other_speech_does_not() -> None:
    predicted, _, truth = opening("en-us")
    _, _, other = opening("de")
    count = min(len(predicted), len(other))
    own = np.corrcoef(predicted, truth)[0, 1]
    assert np.corrcoef(predicted[:count], other[:count])[0, 1] < own - 0.3
