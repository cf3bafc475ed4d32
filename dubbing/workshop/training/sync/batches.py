"""Batches for the two-stream network: matching mouths and sounds, a few frames apart.

Letters: P stretches of a batch, G items of one, B = P G items, V = 5 mouth frames, M mouth points,
R rows and C columns of a crop, A = 10 sound steps, D = 144 channels.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from dubbing.sync.network.channels import centred, running_mean
from dubbing.sync.network.embeddings import mouth_windows
from dubbing.sync.network.streams import MOUTH_STEP
from dubbing.workshop.training.sync.augmentation import mouth_sides, vary_mouth, vary_sound
from dubbing.workshop.training.sync.clips import TalkingClip
from dubbing.workshop.training.sync.pixel_augmentation import vary_pixels
from dubbing.workshop.training.sync.takes import Take, take_windows

STRETCHES = 24
ITEMS = 12
# A mouth is compared with its mean over +- one of these, so that short videos work as well.
MEAN_RADII_S = (1.5, 2.5, 4.0, 8.0)


class Stretch(NamedTuple):
    """Moments (G,) of the clip with this number, in seconds, spoken at another tempo."""

    clip: int
    moments: np.ndarray
    tempo: float


class Lips:
    """Lip geometry of stretches."""

    def __init__(self, clips: Sequence[TalkingClip]) -> None:
        self._clips = clips
        self._shapes = [
            [centred(c.shapes, c.times, radius) for radius in MEAN_RADII_S] for c in clips
        ]
        self._sides = mouth_sides(clips)

    def draw(self, stretches: Sequence[Stretch], rng: np.random.Generator) -> Tensor:
        """Varied mouths (B, V, 2 M)."""
        mouths = []
        for index, moments, tempo in stretches:
            shapes = self._shapes[index][rng.integers(len(MEAN_RADII_S))]
            mouth = mouth_windows(shapes, self._clips[index].times, moments, tempo)
            mouths.append(vary_mouth(mouth, self._sides, rng))
        return torch.from_numpy(np.concatenate(mouths))


class Pixels:
    """Crops of the mouth of stretches."""

    def __init__(self, clips: Sequence[TalkingClip]) -> None:
        self._clips = clips
        self._crops = [c.crops.reshape(len(c.crops), -1).astype(np.float32) for c in clips]
        self._means = [
            [running_mean(flat, clip.times, radius) for radius in MEAN_RADII_S]
            for flat, clip in zip(self._crops, clips, strict=True)
        ]

    def draw(self, stretches: Sequence[Stretch], rng: np.random.Generator) -> Tensor:
        """Varied mouths (B, V, R C)."""
        mouths, means = [], []
        for index, moments, tempo in stretches:
            times = self._clips[index].times
            mouths.append(mouth_windows(self._crops[index], times, moments, tempo))
            middle = int(np.searchsorted(times, moments[len(moments) // 2], side="right")) - 1
            means.append(self._means[index][rng.integers(len(MEAN_RADII_S))][max(middle, 0)])
        return vary_pixels(np.stack(mouths), np.stack(means), rng)


class Batches:
    """Batches of matching mouths and sounds, for a member that takes `mouth_kind` channels.

    Items of one stretch are the hard negatives of one another, those of other clips the easy ones.
    """

    def __init__(
        self, clips: Sequence[TalkingClip], mouth_kind: str, rng: np.random.Generator
    ) -> None:
        self._clips = clips
        self._rng = rng
        self._mouths = Pixels(clips) if mouth_kind == "pixels" else Lips(clips)
        # A person with 10 s counts in full; more of the same person helps little.
        weights = np.array([min(1.0, c.times[-1] / 10) ** 0.5 for c in clips])
        self._weights = weights / weights.sum()

    def draw(self) -> tuple[Tensor, Tensor]:
        """Mouths (B, V, ...) and the sounds (B, A, D) that belong to them."""
        stretches = [self._stretch() for _ in range(STRETCHES)]
        mouths = self._mouths.draw(stretches, self._rng)
        sounds = np.concatenate([self._sounds(stretch) for stretch in stretches])
        return mouths, torch.from_numpy(sounds)

    def _stretch(self) -> Stretch:
        rng = self._rng
        index = int(rng.choice(len(self._clips), p=self._weights))
        times = self._clips[index].times
        # Speaking faster or slower: mouth and sound stretch alike.
        tempo = float(np.exp(rng.uniform(-0.12, 0.12)))
        span = np.arange(ITEMS) * MOUTH_STEP * rng.choice([1, 2, 3, 4]) * tempo
        first, last = times[0] + 0.15, times[-1] - 0.15 - span[-1]
        moments = rng.uniform(first, max(first + 0.01, last)) + span
        return Stretch(index, np.minimum(moments, times[-1] - 0.05), tempo)

    def _sounds(self, stretch: Stretch) -> np.ndarray:
        clip, rng = self._clips[stretch.clip], self._rng
        take = (Take(1.0, clip.sound), *clip.takes)[rng.integers(len(clip.takes) + 1)]
        return vary_sound(take_windows(take, stretch.moments + clip.offset, stretch.tempo), rng)
