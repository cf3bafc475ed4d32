"""A clip with its preparation and rendered heads, to be assembled."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np

from dubbing.mixing.sound import Sound
from dubbing.preparation.prepared import PreparedClip
from dubbing.script.timeline import Cue
from dubbing.video.assembly import make
from dubbing.video.heads import Heads, read_heads
from dubbing.video.own_pixels import reasons, views
from dubbing.video.settings import VideoSettings
from tests import clips, fakes

SIZE = (96, 64)


def quiet(_message: str, _share: float) -> None:
    pass


def kept_of(clip: PreparedClip) -> np.ndarray:
    return reasons(clip, views(clip))


def recording(audio: Path, start: float, seconds: float, frames: int) -> Sound:
    """The sound of a dub of one recording."""
    return Sound((Cue("ann", 0, frames, audio, start, seconds),))


class Scene:
    """A numbered clip, its fake preparation, and sound."""

    def __init__(
        self, folder: Path, frames: int, rate: Fraction = Fraction(25), pixels: str = "bgr0"
    ) -> None:
        self.folder = folder
        self.rate = rate
        self.clip = clips.write_clip(folder / "clip.mkv", frames, rate, size=SIZE, pixels=pixels)
        self.prepared = folder / "prepared"
        fakes.write_prepared(self.clip, self.prepared, window=(40, 20, 32), invalid=(3,))
        self.audio = clips.write_sound(folder / "a.wav", 3, 44100, 2)

    def make(self, poses: np.ndarray, name: str = "out", **settings: object) -> Path:
        fakes.write_heads(self.folder / "heads", len(poses), self.rate)
        seconds = float(len(poses) / self.rate)
        seconds = float(settings.pop("seconds", seconds))  # type: ignore[arg-type]
        chosen = VideoSettings(**settings)  # type: ignore[arg-type]
        prepared = PreparedClip.load(self.prepared)
        return make(
            [
                Heads(
                    partial(read_heads, self.folder / "heads"),
                    prepared,
                    0,
                    len(poses),
                    kept_of(prepared),
                )
            ],
            recording(self.audio, 0.0, seconds, len(poses)),
            self.folder / name,
            pose_index=poses,
            settings=chosen,
            progress=quiet,
        )
