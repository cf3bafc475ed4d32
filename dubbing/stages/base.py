"""Base of the stages, and the prepared clips that several of them read."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from dubbing.engine.graph.stage import Stage

if TYPE_CHECKING:
    from dubbing.preparation.prepared import PreparedClip

RECORDED = ("dfrf", "torch", "numpy")  # packages whose versions a record names
PROCESS_BYTES = 0.8e9  # that a process holds: torch and the models


@dataclass(frozen=True, kw_only=True)
class DubbingStage(Stage):
    """A stage of a dub or of a person."""

    packages: ClassVar[tuple[str, ...]] = ("dfrf", "dubbing")
    # No result depends on messages, nor on how stages are brought up to date.
    without_effect: ClassVar[tuple[str, ...]] = ("dubbing.engine", "dubbing.errors")

    def memory(self) -> float:
        return PROCESS_BYTES

    def needs_gpu(self) -> bool:
        return getattr(self, "device", "") == "cuda"

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Versions of packages, without importing them, and of ffmpeg."""
        from dubbing.media.opening import ffmpeg

        found = {}
        for package in RECORDED:
            with suppress(metadata.PackageNotFoundError):
                found[package] = metadata.version(package)
        return {**found, "ffmpeg": ffmpeg.version()}


@dataclass(frozen=True)
class Prepared:
    """A prepared clip: the stage that makes it, and the clip that it is made from."""

    stage: Stage
    clip: Path

    def load(self) -> PreparedClip:
        """See `PreparedClip.load`."""
        from dubbing.preparation.prepared import PreparedClip

        return PreparedClip.load(self.stage.folder, self.clip)
