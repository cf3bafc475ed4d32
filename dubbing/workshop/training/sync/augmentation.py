"""Lips and sounds, varied as people, cameras, microphones and renders vary them.

Letters: G = items of one stretch of one clip, V = 5 mouth frames, M mouth points, A = 10 sound
steps, D = 144 channels, of which the first are log-mel.
"""

from collections.abc import Sequence

import numpy as np

from dubbing.face.mouth.mouth_shape import MOUTH
from dubbing.sync.network.channels import SOUND_CHANNELS
from dubbing.workshop.training.sync.clips import TalkingClip

# What is added to every speech feature, whose deviation is about 1.
RNN_NOISE = 0.1
# Each mouth point and the one opposite in the mirror.
_ACROSS = {61: 291, 146: 375, 91: 321, 181: 405, 84: 314, 17: 17, 0: 0, 37: 267, 39: 269, 40: 270}
_ACROSS |= {185: 409, 78: 308, 95: 324, 88: 318, 178: 402, 87: 317, 14: 14, 13: 13, 82: 312}
_ACROSS |= {81: 311, 80: 310, 191: 415, 152: 152, 148: 377, 176: 400, 199: 199, 200: 200, 18: 18}
_ACROSS |= {b: a for a, b in _ACROSS.items()}
MIRROR = np.array([MOUTH.index(_ACROSS[p]) for p in MOUTH])


def mouth_sides(clips: Sequence[TalkingClip]) -> np.ndarray:
    """Where each mouth point lies across the mean mouth, from -1 to 1, (M,)."""
    across = np.mean([clip.shapes[..., 0].mean(0) for clip in clips], axis=0)
    across = across - across.mean()
    return (across / np.abs(across).max()).astype(np.float32)


def vary_mouth(mouths: np.ndarray, sides: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Mirrors, scales, turns and shakes the mouths (G, V, 2 M) of one stretch.

    The pose: a turned face shows one side's motion larger than the other's (`sides`, (M,)), and
    sheared. The shake is that of landmarks on compressed or rendered pixels: of the whole mouth
    in every frame, and of every point.
    """
    points = mouths.reshape(*mouths.shape[:2], -1, 2)
    if rng.random() < 0.5:
        points = points[:, :, MIRROR] * np.array([-1, 1], np.float32)
    points = points * np.exp(rng.normal(0, 0.15, 2) + rng.normal(0, 0.15))
    angle = rng.normal(0, 0.08)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    points = points @ turn + rng.normal(0, 0.004, 2)
    whole, each = rng.uniform(0, 0.006), rng.uniform(0, 0.008)
    points = points + rng.normal(0, whole, (*points.shape[:2], 1, 2))
    points = points + rng.normal(0, each, points.shape)
    points = points * (1 + np.clip(rng.normal(0, 0.2), -0.5, 0.5) * sides)[:, None]
    points = points + points[..., ::-1] * rng.normal(0, 0.12, 2)
    return points.reshape(mouths.shape).astype(np.float32)


def vary_sound(sound: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Sounds (G, A, D) with both kinds of channels varied, each in its own way."""
    mel, rnn = (sound[..., SOUND_CHANNELS[name]] for name in ("mel", "rnn"))
    parts = [vary_mel(mel, rng), rnn + rng.normal(0, RNN_NOISE, rnn.shape)]
    return np.concatenate(parts, axis=-1).astype(np.float32)


def vary_mel(mel: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Another voice (bands shifted), microphone (tilt) and noise for log-mels (G, A, 80)."""
    bands = np.arange(mel.shape[-1])
    place = (bands + rng.uniform(-2, 2)) * np.exp(rng.normal(0, 0.05))
    low = np.clip(place, 0, len(bands) - 2).astype(int)
    part = np.clip(place, 0, len(bands) - 1) - low
    mel = mel[..., low] * (1 - part) + mel[..., low + 1] * part
    waves = np.cos(np.pi * np.outer(np.arange(4), bands + 0.5) / len(bands))
    mel = mel + rng.normal(0, 0.08, 4) @ waves
    if rng.random() < 0.5:
        noise = rng.uniform(0, 0.8) + rng.normal(0, 0.1, mel.shape)
        noise += rng.normal(0, 0.15) * np.linspace(-1, 1, len(bands))
        # Powers add: a soft maximum of the logarithms (8 is about ln 10 times the range in bels).
        mel = np.logaddexp(8 * mel, 8 * noise) / 8
    return mel.astype(np.float32)
