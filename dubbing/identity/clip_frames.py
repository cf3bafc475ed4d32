"""The frames of one clip that a person is fine-tuned on, and those in which the head is turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking.reach import views_of
from dubbing.sound_to_lips.speech_frames import SpeechFrames

FURTHER = np.radians(8.0)  # from every learned view: nearer ones are learned well enough
APART = np.radians(2.0)  # views nearer to one another show the same
MOST = 40  # frames


@dataclass(frozen=True)
class ClipFrames:
    """Chosen frames of one clip of a person.

    Attributes:
        clip: the prepared clip.
        speech: of every frame of the clip.
        frames: numbers of the chosen frames, rising, including those without a face, (F,). Speech
            windows do not reach across a gap between them.
    """

    clip: PreparedClip
    speech: SpeechFrames
    frames: np.ndarray

    @property
    def with_face(self) -> np.ndarray:
        """The chosen frames that show the face."""
        return self.frames[self.clip.detected[self.frames]]

    def taken_by(self, camera: PreparedClip) -> np.ndarray:
        """The similarity (2, 3) from px of the crop to those that the camera of a clip takes.

        Crops of both have one middle.
        """
        ratio = camera.focal / self.clip.focal
        shift = (camera.size - 1) / 2 - ratio * (self.clip.size - 1) / 2
        return np.array([[ratio, 0, shift], [0, ratio, shift]])

    def landmarks(self, camera: PreparedClip) -> np.ndarray:
        """Landmarks (F', 478, 2) of these, px as the camera of a clip takes them."""
        return placed(self.clip.landmarks[self.with_face], self.taken_by(camera))


def placed(points: np.ndarray, similarity: np.ndarray) -> np.ndarray:
    """Points (..., 2) after a similarity (2, 3)."""
    return np.asarray(points @ similarity[:, :2].T + similarity[:, 2])


def with_turned(footage: Sequence[ClipFrames]) -> list[ClipFrames]:
    """The learned frames of clips of one person, and up to `MOST` that are turned further.

    Each is the one furthest from all views so far; none is covered.
    """
    if not any(len(one.with_face) for one in footage):
        return list(footage)
    clips = [one.clip for one in footage]
    ends = np.cumsum([0, *map(len, clips)])
    views = np.concatenate([views_of(clip.rotation, clip.translation) for clip in clips])
    clear = np.concatenate([clip.detected & ~clip.covered & ~clip.over for clip in clips])
    learned = np.concatenate([a + one.with_face for a, one in zip(ends, footage, strict=False)])
    near = np.concatenate([(views[a:b] @ views[learned].T).max(1) for a, b in pairwise(ends)])
    left = np.where(clear & (near < np.cos(FURTHER)), near, np.inf)
    chosen: list[int] = []
    while len(chosen) < MOST and left.min() < np.cos(APART):
        chosen.append(int(left.argmin()))
        left = np.maximum(left, views @ views[chosen[-1]])
    turned = np.array(sorted(chosen), int)
    return [
        replace(one, frames=np.union1d(one.frames, turned[(turned >= a) & (turned < b)] - a))
        for one, (a, b) in zip(footage, pairwise(ends), strict=True)
    ]
