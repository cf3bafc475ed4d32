"""Errors that a person can act on: what happened, where, and what to do.

ExplainedError
├── CallError     the call cannot be meant so; nothing was started
├── LockedError   another run works in the same place
└── StageError    a stage could not finish; only what depends on it stops
"""

from typing import Any


class ExplainedError(Exception):
    """An error with its place (a file, a key, a frame) and a remedy."""

    def __init__(self, what: str, where: str = "", remedy: str = "") -> None:
        self.what = what
        self.where = where
        self.remedy = remedy
        text = what + (f" ({where})" if where else "") + (f": {remedy}" if remedy else "")
        super().__init__(text)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.what, self.where, self.remedy)


class CallError(ExplainedError):
    """The call cannot be meant as it was given; nothing was started."""


class LockedError(ExplainedError):
    """Another run works in the same place."""


class StageError(ExplainedError):
    """A stage could not finish."""
