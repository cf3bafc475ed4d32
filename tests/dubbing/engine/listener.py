"""A reporter for tests."""

from __future__ import annotations

from dubbing.engine.graph.graph import Job
from dubbing.engine.graph.stage import Stage
from dubbing.engine.running.outcome import Failure


class Listener:
    """Remembers which stages ran."""

    def __init__(self) -> None:
        self.began: list[str] = []

    def overall(self, done: int, total: int) -> None:
        assert 0 <= done <= total

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        self.began.append(f"{job.name}:{stage.kind}")

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        assert 0 <= share <= 1

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        pass
