"""The frames of one clip that a person is fine-tuned on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames


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

    def c2w(self) -> np.ndarray:
        """Poses of the frames that show the face, see `PreparedClip.c2w`."""
        return self.clip.c2w()[self.with_face]

    def landmarks(self, focal: float) -> np.ndarray:
        """Landmarks (F', 478, 2) of these in a camera of `focal` px at the same place."""
        centre = self.clip.centre[self.with_face][:, None]
        return centre + (self.clip.landmarks[self.with_face] - centre) * (focal / self.clip.focal)
