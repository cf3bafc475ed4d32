"""A graph of tiny stages, as another process declares it again from its "manifest".

That is JSON: ``out`` a folder, ``people`` names, ``dubs`` a person; or several, as ``ann bob``, of
whom each has a line of their own; ``parts`` of a render, each of some steps, none by default. What
a name begins with says how its stages go: bad, worse, killed, killed_once, slow; else well. Every
stage that is begun leaves a line in the log, every step that is done one in that of the steps.
"""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dubbing.engine.graph import Job, Jobs
from dubbing.engine.stage import Progress, Stage
from dubbing.errors import MediaError

MODULE = __name__
LOG, STEPS_LOG = "log.txt", "steps.txt"
STEPS = 5
FIRST_PART, PARTS = "0-1", ("0-1", "2-3")  # steps 0 and 1, 2 and 3; 4 is left to the stage


@dataclass(frozen=True)
class Write:
    """Writes a file in steps, of what its stage reads."""

    name: str
    stage: str
    reads: tuple[Path, ...]
    log: Path
    part: str = ""

    def __call__(self, out: Path, progress: Progress) -> None:
        began = f"{self.name}/{self.stage}{self.part and f' {self.part}'}"
        with open(self.log, "a", encoding="utf-8") as log:
            log.write(f"{began}\n")
        if self.stage == "prepare" or self.part == FIRST_PART:
            self._go_wrong(began)
        for step in map(int, self.part.split("-")) if self.part else range(STEPS):
            if (out / f"{step}.txt").exists():
                continue
            if self.name.startswith("slow"):
                time.sleep(0.1)
            (out / f"{step}.txt").write_text(f"{self.name} {self.stage} {step}")
            with open(self.log.with_name(STEPS_LOG), "a", encoding="utf-8") as log:
                log.write(f"{began} {step}\n")
            progress(f"step {step}", (step + 1) / STEPS)
        if self.part:
            return
        read = [(folder / "all.txt").read_text() for folder in self.reads]
        (out / "all.txt").write_text(f"{self.name}/{self.stage}({', '.join(read)})")

    def _go_wrong(self, began: str) -> None:
        if self.name.startswith("bad"):
            raise MediaError("cannot", "bad.mp4", "do this")
        if self.name.startswith("worse"):
            raise ValueError("nobody thought of this")
        first = self.log.read_text().count(f"{began}\n") == 1
        if self.name == "killed" or (self.name == "killed_once" and first):
            os.kill(os.getpid(), signal.SIGKILL)


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

    def stage(job: str, name: str, *reads: Stage) -> Stage:
        produce = Write(Path(job).name, name, tuple(source.folder for source in reads), log)
        kind = name.partition(" ")[0]
        inputs = {str(source.folder.relative_to(out)): source for source in reads}
        named = content["parts"] if kind == "render" else ()
        parts = {part: replace(produce, part=part) for part in named}
        return Stage(kind, out / job / name, "1", {}, inputs, produce, parts)

    identities, dubs = {}, {}
    for name in content["people"]:
        prepare = stage(f"identities/{name}", "prepare")
        source = stage(f"identities/{name}", "check_source")
        finetune = stage(f"identities/{name}", "finetune", prepare, source)
        stages = {s.name: s for s in (prepare, source, finetune)}
        identities[name] = Job("identity", name, stages)
    for name, named in content["dubs"].items():
        spoken: dict[str, Stage] = {}
        heads = []
        for person in named.split():
            of = f" {person}" if " " in named else ""
            listen = stage(f"dubs/{name}", f"listen{of}")
            finetune = identities[person].stages["finetune"]
            render = stage(f"dubs/{name}", f"render{of}", finetune, listen)
            spoken |= {f"listen{of}": listen, f"render{of}": render}
            heads.append(render)
        if len(heads) > 1:
            spoken["composite"] = stage(f"dubs/{name}", "composite", *heads)
        dubs[name] = Job("dub", name, spoken, tuple(named.split()))
    return Jobs(identities, dubs)


def job_of(path: Path, label: str, _device: str) -> Job:
    """One of them; see `dubbing.batch.jobs.job_of`."""
    return next(job for job in jobs_of(path).all() if job.label == label)


def steps(path: Path) -> list[str]:
    """Which steps were done, in their order, each after what `begun` says of it."""
    return (path.parent / STEPS_LOG).read_text().splitlines()


def begun(path: Path) -> list[str]:
    """Which stages were begun, in their order, by name of the job and of the stage."""
    return (path.parent / LOG).read_text().splitlines()


def results(path: Path) -> dict[str, str]:
    """What lies in the output folder, but for the records: file -> content."""
    out = Path(json.loads(path.read_text())["out"])
    return {
        str(file.relative_to(out)): file.read_text() if file.is_file() else "folder"
        for file in sorted(out.rglob("*"))
        if file.name != "stage.json"
    }
