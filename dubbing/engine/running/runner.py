"""Doing the stages of many jobs: each is submitted as soon as what it needs is done.

A failed stage stops the stages that need its result, nothing else. A stage on which another run is
at work is waited for, and its result is used.
"""

import heapq
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from graphlib import TopologicalSorter
from pathlib import Path

from ..disk import claims
from ..disk.claims import Watch
from ..errors import StageError
from ..graph.graph import Job, Jobs, Node, nodes
from ..graph.part import Part
from ..graph.stage import Stage
from ..graph.stage_id import StageId
from .executors import FAILED, HELD, KILLED, MADE, Done, Executor, InLine, Task
from .outcome import Failure, Outcome, Reporter, failure_of
from .update import check_unchanged

TRIES = 3  # of a stage whose process is killed
LOOK_S = 1.0  # between looks at other processes; longer where there are hundreds
VISIBILITY_TIMEOUT_S = 60.0  # until a result of another machine is visible here, at most


@dataclass(frozen=True)
class Options:
    """Options of a run. ``force``: kinds of stages to do again."""

    force: tuple[str, ...] = ()
    keep_going: bool = True


def run(
    jobs: Jobs, options: Options, reporter: Reporter, executor: Executor | None = None
) -> dict[str, Outcome]:
    """Do everything that is not up to date; outcomes by the label of the job.

    Args:
        executor: where it is done; in this process by default.
    """
    runner = _Runner(jobs, options, reporter, executor or InLine())
    runner.loop()
    return runner.outcomes


class _Runner:
    def __init__(
        self, jobs: Jobs, options: Options, reporter: Reporter, executor: Executor
    ) -> None:
        self.jobs, self.options = jobs, options
        self.reporter, self.executor = reporter, executor
        self.outcomes = {job.label: Outcome() for job in jobs.all()}
        for job in jobs.all():
            if job.blocked:
                failure = failure_of("input", job.blocked)
                self.outcomes[job.label] = Outcome("failed", failure=failure)
        # Parts are done side by side; a stage that is done afresh is done in one go.
        self.graph = nodes(jobs, lambda s: not executor.here and s.kind not in options.force)
        self.order = TopologicalSorter({key: node.needs for key, node in self.graph.items()})
        self.order.prepare()
        self.ready: list[tuple[int, StageId]] = []
        self._add_ready()
        self.running: set[StageId] = set()
        self.elsewhere: dict[StageId, Watch] = {}  # at work in another run
        self.settled: set[StageId] = set()
        self.lost: dict[StageId, Failure] = {}  # stages that failed
        self.begun: set[StageId] = set()
        self.reasons: dict[StageId, list[str]] = {}
        self.tries: dict[StageId, int] = {}
        self.looked = 0.0
        # The whole run uses the inputs as they are now.
        self.began: dict[Path, str] = {}
        for node in self.graph.values():
            with self._failing(node):
                self.began |= node.stage.sources()

    @contextmanager
    def _failing(self, node: Node) -> Iterator[None]:
        """An error in the body fails this stage, and those that need its result."""
        try:
            yield
        except Exception as error:
            self._lose(node, failure_of(node.stage.id.kind, error))

    def _lose(self, node: Node, failure: Failure) -> None:
        """Record the failure of a stage; a job keeps the first one."""
        self.lost[node.stage.id] = failure
        outcome = self.outcomes[node.job.label]
        if outcome.failure is None:
            outcome.state, outcome.failure = FAILED, failure

    def loop(self) -> None:
        """Submit and settle stages until none is left that can be done."""
        self._submit_ready()
        while self.running or self.elsewhere:
            for done in self.executor.wait(claims.POLL_S):
                self._settle(self.graph[done.id], done)
            self._look()
            self._submit_ready()
        self._mark_unfinished()

    def _submit_ready(self) -> None:
        if self._stopped():
            self.ready.clear()
            self.elsewhere.clear()
            self.running.difference_update(self.executor.drop())
        while self.ready:
            _, key = heapq.heappop(self.ready)
            node = self.graph[key]
            if node.stage.id in self.lost:
                continue
            with self._failing(node):
                forced = node.stage.id.kind in self.options.force
                reasons = ["forced"] if forced else node.stage.changes()
                if not reasons:
                    self._finish(node)
                elif (watch := Watch(node.stage.folder)).free():
                    self._submit(node, reasons)
                else:
                    self._wait_for(node, watch)

    def _submit(self, node: Node, reasons: list[str]) -> None:
        check_unchanged(node.stage, node.stage.sources(), self.began)
        self.reasons[node.stage.id] = reasons
        self.running.add(node.stage.id)
        progress = partial(self.reporter.progress, node.job, node.stage)
        forced = node.stage.id.kind in self.options.force
        begin = partial(self._begin, node)
        task = Task(node.rank, node.stage, forced, self.began, begin, progress)
        self.executor.submit(task)

    def _wait_for(self, node: Node, watch: Watch) -> None:
        self.reasons.setdefault(node.stage.id, ["another run is at work on it"])
        self.elsewhere[node.stage.id] = watch

    def _begin(self, node: Node) -> None:
        if node.stage.id not in self.begun:
            self.begun.add(node.stage.id)
            self.reporter.begin(node.job, node.stage, self.reasons[node.stage.id])

    def _look(self) -> None:
        """Report how far the stages of other processes are, and free those that ended."""
        others = [*self.elsewhere, *(() if self.executor.here else self.running)]
        if time.monotonic() - self.looked < max(LOOK_S, len(others) * LOOK_S / 100):
            return
        self.looked = time.monotonic()
        for key in others:
            node = self.graph[key]
            if life := claims.look(node.stage.folder):
                self._begin(node)
                self.reporter.progress(node.job, node.stage, life.message, life.share)
            if key in self.elsewhere and self._free(node, self.elsewhere[key]):
                del self.elsewhere[key]
                if node.stage.id not in self.lost:
                    heapq.heappush(self.ready, (node.rank, key))

    def _free(self, node: Node, watch: Watch) -> bool:
        """Whether nobody holds a stage (any more); it is lost where a dead claim stays."""
        with self._failing(node):
            return watch.free()
        return True

    def _settle(self, node: Node, done: Done) -> None:
        self.running.discard(node.stage.id)
        failure = done.failure
        if done.state == HELD:
            self._wait_for(node, Watch(node.stage.folder))
            return
        if done.state == KILLED:
            self._free(node, Watch(node.stage.folder))  # which sweeps its claim away
            self.tries[node.stage.id] = self.tries.get(node.stage.id, 0) + 1
            if self.tries[node.stage.id] < TRIES:
                heapq.heappush(self.ready, (node.rank, node.stage.id))
                return
            remedy = "run again, with fewer --jobs if memory ran short"
            what = f"its process was killed, {TRIES} times"
            failure = Failure(node.stage.id.kind, what, remedy=remedy)
        self._begin(node)
        outcome = self.outcomes[node.job.label]
        if done.state == MADE or failure:
            kind = node.stage.id.kind
            outcome.reasons.setdefault(kind, self.reasons[node.stage.id])
            outcome.seconds[kind] = outcome.seconds.get(kind, 0.0) + done.seconds
            outcome.state = "made" if outcome.state == "kept" else outcome.state
        if failure:
            self._lose(node, failure)
            self._end(node, failure)
            return
        with self._failing(node):
            if not isinstance(node.stage, Part):  # missing files of a part are made again
                self._await_result(node.stage)
            self._finish(node)

    def _await_result(self, stage: Stage) -> None:
        """Wait until the result is visible here: a network may show an older state of a folder."""
        waited = time.monotonic() + VISIBILITY_TIMEOUT_S
        while (record := stage.record()) is None or record["key"] != stage.key():
            if time.monotonic() > waited:
                what = "it was made, but cannot be seen from here"
                raise StageError(what, str(stage.folder), "share the output folder, then run again")
            with suppress(OSError):
                os.listdir(stage.folder.parent)
            time.sleep(claims.POLL_S)

    def _finish(self, node: Node) -> None:
        """A stage is up to date: stages that need it may be ready now."""
        self.settled.add(node.stage.id)
        self._end(node, None)
        self.order.done(node.stage.id)
        self._add_ready()

    def _add_ready(self) -> None:
        for key in self.order.get_ready():
            heapq.heappush(self.ready, (self.graph[key].rank, key))

    def _end(self, node: Node, failure: Failure | None) -> None:
        if node.stage.id in self.begun:
            self.begun.remove(node.stage.id)
            self.reporter.end(node.job, node.stage, failure)
        self.reporter.overall(len(self.settled), len(self.graph))

    def _stopped(self) -> bool:
        """Whether a failure ends the run; what has not begun is dropped then."""
        return not self.options.keep_going and any(
            outcome.state == "failed" for outcome in self.outcomes.values()
        )

    def _mark_unfinished(self) -> None:
        """Mark jobs that are neither done nor failed: one before failed, or the run stopped."""
        for job in self.jobs.all():
            outcome = self.outcomes[job.label]
            left = [stage for name, stage in job.stages.items() if name not in self.settled]
            if outcome.failure or (job.stages and not left):
                continue
            if (before := self._failed_before(job, left)) is not None:
                failed, failure = before
                what = f"{failed.kind} {failed.name} failed: {failure.what}"
                outcome.failure = replace(failure, what=what, trace="")
                outcome.state = "skipped"
            elif not self.options.keep_going:
                outcome.state = "stopped"

    def _failed_before(self, job: Job, left: list[Stage]) -> tuple[Job, Failure] | None:
        """The job whose failure keeps a job from being done, and that failure."""
        before = {name for stage in left for name in stage.ancestors()}
        for other in (self.jobs.by_label[label] for label in job.waits_for):
            own = self.outcomes[other.label].failure if other.blocked else None
            lost = (self.lost[name] for name in other.stages if name in self.lost.keys() & before)
            if failure := own or next(lost, None):
                return other, failure
        return None
