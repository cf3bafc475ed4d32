"""The outcome of a stage and of a job, and the interface of displays."""

import traceback
from dataclasses import dataclass, field
from typing import Protocol

from ..disk.files import system_error
from ..errors import ExplainedError
from ..graph.graph import Job
from ..graph.stage import Stage
from ..memory import ROOM, SHORT, short_of_memory


@dataclass(frozen=True)
class Failure:
    """Why a stage failed, in words; ``trace`` only where nobody foresaw it."""

    stage: str
    what: str
    where: str = ""
    remedy: str = ""
    trace: str = ""

    def __str__(self) -> str:
        return str(ExplainedError(self.what, self.where, self.remedy))


@dataclass
class Outcome:
    """The outcome of one job in this run.

    Attributes:
        state: made, kept (all was up to date), failed, skipped (a job before it failed), or stopped
            (not finished because another failed and ``keep_going`` was off).
        reasons: kind of stage -> why it had to run.
        seconds: kind of stage -> how long it took.
    """

    state: str = "kept"
    reasons: dict[str, list[str]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    failure: Failure | None = None


class Reporter(Protocol):
    """Shows how the work goes on."""

    def overall(self, done: int, total: int) -> None:
        """So many of all stages are done."""

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        """A stage starts."""

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        """A stage is ``share`` (0..1) done."""

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        """A stage is done or has failed."""


def failure_of(stage: str, error: BaseException) -> Failure:
    """An error as something to show to people."""
    if isinstance(error, ExplainedError):
        return Failure(stage, error.what, error.where, error.remedy)
    trace = "".join(traceback.format_exception(error))
    what = f"{type(error).__name__}: {error}"
    if short_of_memory(error):
        return Failure(stage, SHORT, str(error), ROOM, trace)
    if isinstance(error, OSError) and error.errno:
        refused = system_error(error)
        return Failure(stage, refused.what, refused.where, refused.remedy, trace)
    return Failure(stage, what, "not foreseen", "see the trace; please report it", trace)
