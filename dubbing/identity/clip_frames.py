"""What of one clip a person is learned from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames


@dataclass(frozen=True)
class Footage:
    """Frames of one clip of a person.

    Attributes:
        clip: what `prepare` made of the film.
        speech: of every frame of the clip.
        frames: which of them, in their order, those without a face among them, (F,). What is heard
            at one is not joined to another that does not follow it without a gap.
    """

    clip: PreparedClip
    speech: SpeechFrames
    frames: np.ndarray

    @property
    def with_face(self) -> np.ndarray:
        """Those of the frames that show the face."""
        return self.frames[self.clip.valid[self.frames]]

    def c2w(self) -> np.ndarray:
        """Poses of the frames that show the face, see `PreparedClip.c2w`."""
        return self.clip.c2w()[self.with_face]

    def landmarks(self, focal: float) -> np.ndarray:
        """Landmarks (F', 478, 2) of these as a camera of `focal` px in the same place has them."""
        centre = self.clip.centre[self.with_face][:, None]
        return centre + (self.clip.landmarks[self.with_face] - centre) * (focal / self.clip.focal)
