"""The work of a run, and the reasons for it; nothing is written and nothing heavy is loaded."""

from __future__ import annotations

from dataclasses import dataclass

from ..graph.graph import Job, Jobs
from ..graph.stage import Stage
from ..graph.stage_id import StageId

UP_TO_DATE, RUN, AFTER, BLOCKED = "up to date", "run", "after", "blocked"


@dataclass(frozen=True)
class Row:
    """One stage of one job, or a job that is blocked.

    Attributes:
        stage: None for a job that is blocked.
        state: up to date, run, after (a stage before it runs) or blocked.
    """

    job: Job
    stage: Stage | None
    state: str
    reasons: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The stage as people read it."""
        return self.stage.id.name if self.stage else "all"


def rows(jobs: Jobs, force: tuple[str, ...] = ()) -> list[Row]:
    """All stages in the order in which a run looks at them, job by job."""
    runs: set[StageId] = set()
    found: list[Row] = []
    for job in jobs.all():
        if error := jobs.blocked(job):
            found.append(Row(job, None, BLOCKED, (str(error),)))
            continue
        for stage in job.stages.values():
            row = _row(job, stage, runs, force)
            found.append(row)
            if row.state != UP_TO_DATE:
                runs.add(stage.id)
    return found


def to_do(rows: list[Row]) -> set[StageId]:
    """The stages that will run, or may have to."""
    return {row.stage.id for row in rows if row.stage and row.state in (RUN, AFTER)}


def _row(job: Job, stage: Stage, runs: set[StageId], force: tuple[str, ...]) -> Row:
    before = [
        source.kind
        for source in stage.inputs.values()
        if isinstance(source, Stage) and source.id in runs
    ]
    reasons = ["forced"] if stage.kind in force else stage.changes()
    if reasons:
        return Row(job, stage, RUN, tuple(reasons))
    if before:
        kinds = " or ".join(dict.fromkeys(before))
        return Row(job, stage, AFTER, (f"if {kinds} gives another result",))
    return Row(job, stage, UP_TO_DATE)
