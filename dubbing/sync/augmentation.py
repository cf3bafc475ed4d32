"""Batches for the two-stream network, varied as people, cameras and renders vary.

Letters: B items of a batch, G = items of one stretch of one clip, V = 5 mouth frames,
M mouth points, A = 10 sound steps, D = 144 channels, of which the first are log-mel.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from dubbing.sync.clips import TalkingClip
from dubbing.sync.hearing import CHANNELS, Take
from dubbing.sync.mouth import MOUTH
from dubbing.sync.network import MOUTH_STEP
from dubbing.sync.windows import centred, mouth_windows, take_windows

STRETCHES = 24
ITEMS = 12
# A mouth is centred on its mean over +- one of these, so that short videos work as well.
REACHES = (1.5, 2.5, 4.0, 8.0)
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
    parts = {"mel": vary_mel(sound[..., CHANNELS["mel"]], rng), "rnn": sound[..., CHANNELS["rnn"]]}
    parts["rnn"] = parts["rnn"] + rng.normal(0, RNN_NOISE, parts["rnn"].shape)
    return np.concatenate([parts[name] for name in CHANNELS], axis=-1).astype(np.float32)


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


class Batches:
    """Batches of matching mouths and sounds: stretches of the clips, a few frames apart.

    Items of one stretch are the hard negatives of one another, those of other clips the easy ones.
    """

    def __init__(self, clips: Sequence[TalkingClip], rng: np.random.Generator) -> None:
        self._clips = clips
        self._rng = rng
        self._shapes = [[centred(c.shapes, c.times, reach) for reach in REACHES] for c in clips]
        self._sides = mouth_sides(clips)
        # A person with 10 s counts in full; more of the same person helps little.
        weights = np.array([min(1.0, c.times[-1] / 10) ** 0.5 for c in clips])
        self._weights = weights / weights.sum()

    def draw(self) -> tuple[Tensor, Tensor]:
        """Mouths (B, V, 2 M) and the sounds (B, A, D) that belong to them."""
        pairs = [self._stretch() for _ in range(STRETCHES)]
        mouths, sounds = (np.concatenate(side) for side in zip(*pairs, strict=True))
        return torch.from_numpy(mouths), torch.from_numpy(sounds)

    def _stretch(self) -> tuple[np.ndarray, np.ndarray]:
        rng = self._rng
        index = rng.choice(len(self._clips), p=self._weights)
        clip = self._clips[index]
        shapes = self._shapes[index][rng.integers(len(REACHES))]
        # Speaking faster or slower: mouth and sound stretch alike.
        tempo = np.exp(rng.uniform(-0.12, 0.12))
        span = np.arange(ITEMS) * MOUTH_STEP * rng.choice([1, 2, 3, 4]) * tempo
        first, last = clip.times[0] + 0.15, clip.times[-1] - 0.15 - span[-1]
        moments = rng.uniform(first, max(first + 0.01, last)) + span
        moments = np.minimum(moments, clip.times[-1] - 0.05)
        mouths = mouth_windows(shapes, clip.times, moments, tempo)
        take = (Take(1.0, clip.sound), *clip.takes)[rng.integers(len(clip.takes) + 1)]
        sounds = take_windows(take, moments + clip.offset, tempo)
        return vary_mouth(mouths, self._sides, rng), vary_sound(sounds, rng)
