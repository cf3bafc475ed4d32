"""What a run would do, and why; nothing is written and no torch is loaded."""

from dataclasses import dataclass

from dubbing.engine.graph import Job, Jobs
from dubbing.engine.stage import Stage


@dataclass(frozen=True)
class Row:
    """One stage of one job. ``state``: up to date, run, after (a stage before it runs), blocked."""

    job: Job
    stage: str
    state: str
    reasons: tuple[str, ...] = ()


def rows(jobs: Jobs, force: tuple[str, ...] = ()) -> list[Row]:
    """All stages in the order in which a run looks at them, job by job."""
    runs: set[str] = set()
    found: list[Row] = []
    for job in jobs.all():
        people = (jobs.identities[name].blocked for name in job.waits_for)
        error = job.blocked or next(filter(None, people), None)
        if error:
            found.append(Row(job, "all", "blocked", (str(error),)))
            continue
        for name, stage in job.stages.items():
            row = _row(job, name, stage, runs, force)
            found.append(row)
            if row.state != "up to date":
                runs.add(str(stage.folder))
    return found


def _row(job: Job, name: str, stage: Stage, runs: set[str], force: tuple[str, ...]) -> Row:
    before = [
        source.name
        for source in stage.inputs.values()
        if isinstance(source, Stage) and str(source.folder) in runs
    ]
    reasons = ["forced"] if stage.name in force else stage.changes()
    if reasons:
        return Row(job, name, "run", tuple(reasons))
    if before:
        return Row(job, name, "after", (f"if {' or '.join(before)} gives another result",))
    return Row(job, name, "up to date")
