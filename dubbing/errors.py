"""Errors a person can act on, as `dubbing.engine.errors` has them, and those of dubbing.

    ExplainedError
    ├── ManifestError         the manifest is wrong; carries every problem found
    ├── CallError             the command cannot be meant so; nothing was started
    ├── LockedError           another run works in the same output folder
    ├── MediaError            a video or sound file cannot be read or written
    └── StageError            a stage could not finish; only what depends on it stops
        ├── PreparationError  tracking, matte or background
        ├── TrainingError     base training or fine-tuning
        ├── CheckpointError   a model file that does not load or does not fit
        ├── RenderingError    the head, the composite or the result
        └── SyncError         the lip-sync check

Everything a user can cause ends in one of these; anything else that escapes is a bug.
"""

from dataclasses import dataclass
from typing import Any

from dubbing.engine.errors import CallError, ExplainedError, LockedError, StageError

__all__ = [
    "CallError",
    "CheckpointError",
    "ExplainedError",
    "LockedError",
    "ManifestError",
    "MediaError",
    "PreparationError",
    "Problem",
    "RenderingError",
    "StageError",
    "SyncError",
    "TrainingError",
]


@dataclass(frozen=True, order=True)
class Problem:
    """One thing wrong in a manifest. ``line`` counts from 1; 0 where there is none."""

    line: int
    key: str
    message: str

    def __str__(self) -> str:
        place = f"line {self.line}: " if self.line else ""
        return f"{place}{self.key}: {self.message}" if self.key else f"{place}{self.message}"


class ManifestError(ExplainedError):
    """Every problem of a manifest at once, in the order of its lines."""

    def __init__(self, where: str, problems: list[Problem]) -> None:
        self.manifest = where
        self.problems = sorted(problems)
        count = len(problems)
        what = f"{count} problem{'s' if count != 1 else ''} in {where}"
        super().__init__("\n  ".join([what, *map(str, self.problems)]))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.manifest, self.problems)


class MediaError(ExplainedError):
    """A video or sound file cannot be read or written."""


class PreparationError(StageError):
    """Tracking, matting or the background failed."""


class TrainingError(StageError):
    """Base training or fine-tuning failed."""


class CheckpointError(StageError):
    """A model file does not load, or does not fit what it is used for."""


class RenderingError(StageError):
    """The head, the composite or the finished video failed."""


class SyncError(StageError):
    """The lip-sync check could not be made."""
