"""Times that a dubbing team waits: a first dub, a second line, an edited line or moment, a draft.

    python -m dubbing.workshop.bench.dub_times CLIP SPEECH OUT [--seconds 10] [--size 512]

CLIP shows one person, who may say SPEECH: other seconds of the clip, or any speech for a person who
agreed. OUT is a new folder. Every step is a process of its own, as a user starts it.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from dubbing.engine.disk.files import atomic_write_json

CONSENT = {"by": "for timing alone", "reference": "none: nothing made here leaves this folder"}


@dataclass(frozen=True)
class Wait:
    """A thing that somebody waits for: seconds by the clock, and of each stage that was made."""

    what: str
    seconds: float
    stages: dict[str, float]


def manifest(
    clip: Path, speech: Path, out: Path, *, lengths: Sequence[float], size: int, people: int = 1
) -> dict[str, Any]:
    """A manifest in which everybody has a dub of each length."""
    names = [f"person{k}" for k in range(people)]
    person = {"clip": str(clip), "size": size, "consent": CONSENT}
    dubs = [
        {
            "name": f"{name}_{seconds:g}s",
            "identity": name,
            "audio": str(speech),
            "audio_seconds": seconds,
        }
        for name in names
        for seconds in lengths
    ]
    people_of = {name: {**person, "seed": k} for k, name in enumerate(names)}
    return {"version": 1, "output": str(out), "identities": people_of, "dubs": dubs}


def stage_seconds(work: Path) -> dict[tuple[str, float], float]:
    """Seconds of all stages that are done, by folder and time of their records."""
    return {
        (str(path.parent.relative_to(work)), path.stat().st_mtime): json.loads(path.read_text())[
            "seconds"
        ]
        for path in work.rglob("stage.json")
    }


def dubbed(path: Path, plan: dict[str, Any], *options: str) -> float:
    """Seconds that `dfrf dub` takes for a manifest, written to a path."""
    atomic_write_json(path, plan)  # JSON is YAML, too
    call = [sys.executable, "-m", "dubbing", "dub", str(path), *options]
    began = time.monotonic()
    subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began


def waits(clip: Path, speech: Path, out: Path, seconds: float, size: int) -> list[Wait]:
    """Runs `dfrf dub` again and again, each time after a change."""
    out.mkdir(parents=True)
    path, found = out / "manifest.yaml", []
    plan = manifest(clip, speech, out, lengths=[seconds], size=size)
    first = plan["dubs"][0]
    first["name"] = "one"

    def wait(what: str, *options: str) -> None:
        before = stage_seconds(out / "work") if (out / "work").is_dir() else {}
        took = dubbed(path, plan, *options)
        new = {k: v for k, v in stage_seconds(out / "work").items() if k not in before}
        stages: dict[str, float] = {}
        for (folder, _), spent in new.items():
            kind = Path(folder).name
            stages[kind] = stages.get(kind, 0.0) + spent
        found.append(Wait(what, took, stages))

    wait("first dub")
    wait("a draft of it", "--draft")
    plan["dubs"] = [first, {**first, "name": "two", "audio_start": 1.0}]
    wait("a second dub of the person")
    first["edits"] = {"shift": 80}
    wait("a line that was edited")
    wait("a draft of that", "--draft", "--only", "one")
    first["edits"]["keys"] = [{"at": round(seconds / 3, 2), "strength": 0}]
    wait("a moment of it, with a key")
    return found


def table(found: list[Wait]) -> str:
    """The times as a table in Markdown."""
    rows = [
        f"| {one.what} | {one.seconds:.1f} | "
        + ", ".join(f"{kind} {spent:.1f}" for kind, spent in one.stages.items())
        + " |"
        for one in found
    ]
    return "\n".join(["| | seconds | of which |", "|---|---|---|", *rows])


def main(clip: Path, speech: Path, out: Path, seconds: float = 10.0, size: int = 512) -> None:
    """Prints the table."""
    if out.exists():
        raise typer.BadParameter(f"{out} exists: name a new folder")
    print(table(waits(clip.resolve(), speech.resolve(), out.resolve(), seconds, size)))


if __name__ == "__main__":
    typer.run(main)
