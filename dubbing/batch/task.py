"""The program that brings one stage of a manifest up to date, in a process of its own.

    python -m dubbing.batch.task CALL

Runs start it; CALL is made by `dubbing.engine.running.executors.Program`.
"""

import sys
from pathlib import Path

from dubbing.batch.jobs import build
from dubbing.engine.graph.graph import Job
from dubbing.engine.running import task
from dubbing.engine.running.executors import Program
from dubbing.errors import ExplainedError
from dubbing.manifest.manifest import load
from dubbing.pipeline import PERSON, people_jobs

MODULE = "dubbing.batch.task"
# Modules of stages, which load torch and OpenCV.
LOADED = (
    "dubbing.heads.fine_tuning",
    "dubbing.heads.rendering",
    "dubbing.preparation.prepare",
    "dubbing.sync.check",
    "dubbing.video.assembly",
)
DRAFT = "draft"
# The error where a parameter that depends on the machine differs.
KNOWN = {
    "mark": (
        "the key of the invisible mark",
        "copy mark.key from the settings folder of where the run was started into the one here, "
        "or name a key in the manifest, `mark: {key: FILE}`",
    )
}


def program(manifest: Path, device: str = "auto", draft: bool = False) -> Program:
    """The program for the stages of a manifest, or of its drafts."""
    return Program(MODULE, (str(manifest), device, *[DRAFT] * draft), LOADED)


def job_of(label: str, manifest: str, device: str, draft: str = "") -> Job:
    """One job of a manifest again.

    Raises:
        ExplainedError: the manifest is wrong, or has no such job.
    """
    kind, name = label.split("/", 1)
    # What is prepared of the clips of a person, all dubs say.
    production = load(manifest, only=() if kind == PERSON else (name,))
    if kind == PERSON and name in production.people:
        people, dubs = [production.people[name]], [*production.dubs.values()]
        return people_jobs(people, dubs, production.work, device)[name]
    jobs = build(production, device=device, draft=draft == DRAFT)
    if label not in jobs.by_label:
        raise ExplainedError(f"the manifest has no {kind} {name}", manifest, "run it again")
    return jobs.by_label[label]


def main(argument: str) -> int:
    """Do the task of one call; gives the exit code."""
    return task.main(argument, job_of, KNOWN)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
