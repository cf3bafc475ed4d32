"""Doing the stages of many jobs: one kind of stage over all jobs, then the next.

A failed stage stops its own job and the dubs that wait for it, nothing else.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from dubbing.engine.graph import Job, Jobs
from dubbing.engine.processes import Processes
from dubbing.engine.stage import Progress, Stage, recover, run_stage
from dubbing.errors import DubbingError
from dubbing.files import system_error


@dataclass(frozen=True)
class Failure:
    """Why a stage failed, in words; ``trace`` only where nobody foresaw it."""

    stage: str
    what: str
    where: str = ""
    remedy: str = ""
    trace: str = ""

    def __str__(self) -> str:
        return str(DubbingError(self.what, self.where, self.remedy))


@dataclass
class Outcome:
    """What became of one job in this run.

    Attributes:
        state: made, kept (all was up to date), failed, skipped (its identity failed), or stopped
            (not finished because another failed and ``keep_going`` was off).
        reasons: stage -> why it had to run.
        seconds: stage -> how long it took.
    """

    state: str = "kept"
    reasons: dict[str, list[str]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    failure: Failure | None = None


class Reporter(Protocol):
    """What shows how the work goes on."""

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        """A stage starts."""

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        """A stage is ``share`` (0..1) done."""

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        """A stage is done or has failed."""


@dataclass(frozen=True)
class Options:
    """How a run behaves. ``force``: stage names to do again; ``workers``: jobs side by side."""

    force: tuple[str, ...] = ()
    workers: int = 1
    keep_going: bool = True


def run(jobs: Jobs, options: Options, reporter: Reporter) -> dict[str, Outcome]:
    """Do everything that is not up to date; outcomes by ``kind/name``."""
    outcomes = {job.label: Outcome() for job in jobs.all()}
    for job in jobs.all():
        if job.blocked:
            outcomes[job.label] = Outcome("failed", failure=failure_of("input", job.blocked))
    runner = _Runner(jobs, options, reporter, outcomes)
    for some in (jobs.identities, jobs.dubs):
        kinds = (stage.name for job in some.values() for stage in job.stages.values())
        for kind in dict.fromkeys(kinds):
            runner.everywhere(kind, some)
    runner.mark_unfinished()
    return outcomes


def failure_of(stage: str, error: BaseException) -> Failure:
    """An error as something to show to people."""
    if isinstance(error, DubbingError):
        return Failure(stage, error.what, error.where, error.remedy)
    trace = "".join(traceback.format_exception(error))
    what = f"{type(error).__name__}: {error}"
    if isinstance(error, OSError) and error.errno:
        refused = system_error(error)
        return Failure(stage, refused.what, refused.where, refused.remedy, trace)
    return Failure(stage, what, "not foreseen", "see the trace; please report it", trace)


class _Runner:
    def __init__(
        self, jobs: Jobs, options: Options, reporter: Reporter, outcomes: dict[str, Outcome]
    ) -> None:
        self.jobs = jobs
        self.options = options
        self.reporter = reporter
        self.outcomes = outcomes
        self.lost: set[Path] = set()  # folders of stages that failed
        # Inputs are what they are now, for the whole run.
        self.began: dict[Path, str] = {}
        for job in jobs.all():
            for stage in job.stages.values():
                with self._failing(job, stage):
                    self.began |= stage.sources()

    @contextmanager
    def _failing(self, job: Job, stage: Stage) -> Iterator[None]:
        """What is raised in here fails this stage of this job, and what needs it."""
        outcome = self.outcomes[job.label]
        try:
            yield
        except Exception as error:
            self._lose(outcome, stage, failure_of(stage.name, error))

    def _lose(self, outcome: Outcome, stage: Stage, failure: Failure) -> None:
        """A stage has failed; of several of a job the first is remembered."""
        self.lost.add(stage.folder)
        if outcome.state != "failed":
            outcome.state, outcome.failure = "failed", failure

    def everywhere(self, kind: str, jobs: dict[str, Job]) -> None:
        """One kind of stage over all jobs that still stand."""
        waiting = []
        for job in jobs.values():
            if not job.stages:  # what it is made of cannot be read
                self._stands(job, None)
        of_kind = [
            (job, stage)
            for job in jobs.values()
            for stage in job.stages.values()
            if stage.name == kind
        ]
        for job, stage in of_kind:
            if self._stands(job, stage) and not self._stopped():
                with self._failing(job, stage):
                    recover(stage)
                    forced = kind in self.options.force
                    reasons = ["forced"] if forced else stage.changes()
                    if reasons:
                        waiting.append((job, stage, reasons))
        for job, stage, failure, seconds, reasons in self._done(kind, waiting):
            outcome = self.outcomes[job.label]
            outcome.reasons.setdefault(kind, reasons)
            outcome.seconds[kind] = outcome.seconds.get(kind, 0.0) + seconds
            if failure:
                self._lose(outcome, stage, failure)
            elif outcome.state != "failed":
                outcome.state = "made"
            self.reporter.end(job, stage, failure)

    def _stands(self, job: Job, stage: Stage | None) -> bool:
        """Whether nothing has failed that a stage goes back to; None: that a job begins with."""
        outcome = self.outcomes[job.label]
        if outcome.state == "skipped" or (outcome.failure and outcome.failure.stage == "input"):
            return False
        lost = self.lost & ({stage.folder, *stage.ancestors()} if stage else set())
        for person in (self.jobs.identities[name] for name in job.waits_for):
            failure = self.outcomes[person.label].failure
            own = {its.folder for its in person.stages.values()}
            if failure and (failure.stage == "input" or lost & own):
                what = f"identity {person.name} failed: {failure.what}"
                if outcome.state != "failed":
                    outcome.failure = replace(failure, what=what, trace="")
                    outcome.state = "skipped"
                return False
        return not lost

    def _stopped(self) -> bool:
        return not self.options.keep_going and any(
            outcome.state == "failed" for outcome in self.outcomes.values()
        )

    def mark_unfinished(self) -> None:
        """After a stop: what is neither done nor failed."""
        for job in self.jobs.all() if self._stopped() else []:
            outcome = self.outcomes[job.label]
            for stage in job.stages.values():
                with self._failing(job, stage):
                    if outcome.failure is None and stage.changes():
                        outcome.state = "stopped"

    def _done(
        self, name: str, waiting: list[tuple[Job, Stage, list[str]]]
    ) -> Iterator[tuple[Job, Stage, Failure | None, float, list[str]]]:
        force = name in self.options.force
        if self.options.workers > 1 and len(waiting) > 1:
            yield from self._side_by_side(waiting, force)
            return
        for job, stage, reasons in waiting:
            if self._stopped():
                return
            self.reporter.begin(job, stage, reasons)
            progress = _progress(self.reporter, job, stage)
            failure, seconds = attempt(stage, force, progress, self.began)
            yield job, stage, failure, seconds, reasons

    def _side_by_side(
        self, waiting: list[tuple[Job, Stage, list[str]]], force: bool
    ) -> Iterator[tuple[Job, Stage, Failure | None, float, list[str]]]:
        with Processes(min(self.options.workers, len(waiting))) as processes:
            futures = {}
            for job, stage, reasons in waiting:
                self.reporter.begin(job, stage, reasons)
                future = processes.submit(attempt, stage, force, _silent, self.began)
                futures[future] = (job, stage, reasons)
            for future in as_completed(futures):
                job, stage, reasons = futures[future]
                try:
                    failure, seconds = future.result()
                except BrokenProcessPool:
                    remedy = "run again, with fewer --jobs if memory ran short"
                    failure = Failure(stage.name, "its process was killed", remedy=remedy)
                    seconds = 0.0
                yield job, stage, failure, seconds, reasons


def attempt(
    stage: Stage, force: bool, progress: Progress, began: Mapping[Path, str]
) -> tuple[Failure | None, float]:
    """Run a stage; an error becomes a Failure. Gives the seconds it took.

    Args:
        began: digests of the files that are read, when the run began.
    """
    started = time.perf_counter()
    failure = None
    try:
        run_stage(stage, progress, force=force, began=began)
    except Exception as error:  # whatever a library raises at odd data: its trace is kept
        failure = failure_of(stage.name, error)
    return failure, round(time.perf_counter() - started, 2)


def _progress(reporter: Reporter, job: Job, stage: Stage) -> Callable[[str, float], None]:
    return lambda message, share: reporter.progress(job, stage, message, share)


def _silent(_message: str, _share: float) -> None:
    """Workers do not write to the terminal."""
