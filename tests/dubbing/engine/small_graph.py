"""A graph of tiny stages, which another process makes again from its "manifest".

That is JSON: ``out`` a folder, ``people`` names, ``dubs`` a person; or several, as ``ann bob``, of
whom each has a line of their own; ``parts`` of a render, each of some steps, none by default. The
beginning of a name says how its stages go: bad, worse, killed, killed_once, slow; else well. Every
stage that begins leaves a line in the log, every step that is done one in that of the steps.

    python -m tests.dubbing.engine.small_graph CALL

does the task of one call; see `dubbing.engine.running.executors.Program`.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Self

from dubbing.engine.errors import ExplainedError
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.graph import Job, Jobs
from dubbing.engine.graph.stage import Progress, Stage
from dubbing.engine.running import task
from dubbing.engine.running.executors import Program

MODULE = "tests.dubbing.engine.small_graph"
LOG, STEPS_LOG = "log.txt", "steps.txt"
STEPS = 5
FIRST_PART, PARTS = "0-1", ("0-1", "2-3")  # steps 0 and 1, 2 and 3; 4 is left to the stage


@dataclass(frozen=True, kw_only=True)
class Small(Stage):
    """Writes a file in steps, then one file of what the stages before it wrote.

    Attributes:
        name: of its job.
        named: parts of its work.
        part: the one that is done; '' for all that is left.
    """

    name: str
    reads: tuple[Stage, ...] = ()
    seed: int = 0
    log: Setting[Path]
    named: Setting[tuple[str, ...]] = ()
    part: Setting[str] = ""

    def run(self, out: Path, progress: Progress) -> None:
        began = f"{self.name}/{self.id.name}{self.part and f' {self.part}'}"
        with open(self.log, "a", encoding="utf-8") as log:
            log.write(f"{began}\n")
        if self.kind == "prepare" or self.part == FIRST_PART:
            self._go_wrong(began)
        for step in map(int, self.part.split("-")) if self.part else range(STEPS):
            if (out / f"{step}.txt").exists():
                continue
            if self.name.startswith("slow"):
                time.sleep(0.1)
            (out / f"{step}.txt").write_text(f"{self.name} {self.kind} {step}")
            with open(self.log.with_name(STEPS_LOG), "a", encoding="utf-8") as log:
                log.write(f"{began} {step}\n")
            progress(f"step {step}", (step + 1) / STEPS)
        if self.part:
            return
        read = [(stage.folder / "all.txt").read_text() for stage in self.reads]
        (out / "all.txt").write_text(f"{self.name}/{self.kind}({', '.join(read)})")

    def parts(self) -> Mapping[str, Self]:
        return {part: replace(self, part=part) for part in self.named}

    def amount(self) -> float:
        return float(len(self.part.split("-")) if self.part else STEPS)

    def memory(self) -> float:
        return 1e6 if self.kind == "finetune" else 1e3

    def _go_wrong(self, began: str) -> None:
        if self.name.startswith("bad"):
            raise ExplainedError("cannot", "bad.mp4", "do this")
        if self.name.startswith("worse"):
            raise ValueError("nobody thought of this")
        first = self.log.read_text().count(f"{began}\n") == 1
        if self.name == "killed" or (self.name == "killed_once" and first):
            os.kill(os.getpid(), signal.SIGKILL)


class Prepare(Small):
    """The first stage of a person."""


class CheckSource(Small):
    """Beside `Prepare`."""


class Finetune(Small):
    """Reads both."""


class Listen(Small):
    """The first stage of a line."""


class Render(Small):
    """Reads it, and the `Finetune` of who speaks."""


class Composite(Small):
    """Reads all renders of a dub with several lines."""


def write_manifest(
    folder: Path,
    people: list[str],
    dubs: Mapping[str, str] | None = None,
    parts: Sequence[str] = (),
) -> Path:
    """A manifest whose results go beside it."""
    path = folder / "manifest.json"
    content = {
        "out": str(folder / "out"),
        "people": people,
        "dubs": dict(dubs or {}),
        "parts": parts,
    }
    path.write_text(json.dumps(content))
    (folder / LOG).touch()
    return path


def jobs_of(path: Path) -> Jobs:
    """All jobs of such a manifest."""
    content = json.loads(path.read_text())
    out, log = Path(content["out"]), path.parent / LOG
    jobs: dict[str, Job] = {}
    for name in content["people"]:
        job = jobs[name] = Job("identity", name, out / "identities" / name)
        before = (job.add(Prepare(name=name, log=log)), job.add(CheckSource(name=name, log=log)))
        job.add(Finetune(name=name, log=log, reads=before))
    for name, named in content["dubs"].items():
        people = named.split()
        waits_for = tuple(jobs[person].label for person in people)
        dub = Job("dub", name, out / "dubs" / name, "cues", waits_for)
        heads = []
        for person in people:
            of = person if len(people) > 1 else ""
            listen = dub.add(Listen(name=name, log=log), of)
            reads = (jobs[person].stage(Finetune), listen)
            render = Render(name=name, log=log, reads=reads, named=tuple(content["parts"]))
            heads.append(dub.add(render, of))
        if len(heads) > 1:
            dub.add(Composite(name=name, log=log, reads=tuple(heads)))
        jobs[f"dub/{name}"] = dub
    return Jobs.of(jobs.values())


def job_of(label: str, path: str) -> Job:
    """One of them; see `dubbing.engine.running.task`."""
    return jobs_of(Path(path)).by_label[label]


def program(path: Path) -> Program:
    """The program for the stages of a manifest."""
    return Program(MODULE, (str(path),))


def steps(path: Path) -> list[str]:
    """The steps that were done, in their order, each after its stage as in `begun`."""
    return (path.parent / STEPS_LOG).read_text().splitlines()


def begun(path: Path) -> list[str]:
    """The stages that began, in their order, by name of the job and of the stage."""
    return (path.parent / LOG).read_text().splitlines()


def results(path: Path) -> dict[str, str]:
    """The files in the output folder, but for the records: file -> content."""
    out = Path(json.loads(path.read_text())["out"])
    return {
        str(file.relative_to(out)): file.read_text() if file.is_file() else "folder"
        for file in sorted(out.rglob("*"))
        if file.name != "stage.json"
    }


def main(argument: str) -> int:
    """Do the task of one call."""
    return task.main(argument, job_of)


if __name__ == "__main__":
    own = import_module(MODULE)  # its stages belong to a module with a name, not to __main__
    sys.exit(own.main(sys.argv[1]))
