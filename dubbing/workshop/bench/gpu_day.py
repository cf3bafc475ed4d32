"""Everything that is to be measured on a GPU, in one run of limited time.

    python -m dubbing.workshop.bench.gpu_day OUT [--minutes 25] [--device cuda]

Each part is a process with a limit of its own. What a part made stays, and a part that was done is
not done again: call it again to go on. OUT/table.md has a row for each part, OUT/NAME.log what it
printed. The last part, the published method at its full size, takes the time that is left.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import atomic_write_json, atomic_write_text

MINUTES = 25.0
PERSON = "alba"  # of the demo
EVERY = 1.0  # s between two looks at a part
END = 20.0  # s for a part to save what it has
DONE, STOPPED, FAILED = "done", "stopped at its limit", "failed"


@dataclass(frozen=True)
class Part:
    """One thing that is measured: a call of Python, and the seconds that it may take."""

    name: str
    call: Sequence[str]
    limit: float = float("inf")


@dataclass(frozen=True)
class Outcome:
    """How a part went.

    Attributes:
        how: `DONE`, `STOPPED` or `FAILED`.
        gib: most memory of the device in use meanwhile; 0 without a GPU.
        said: its last line.
    """

    name: str
    how: str
    seconds: float
    gib: float
    said: str


def parts_of(out: Path, device: str) -> list[Part]:
    """The parts; the manifests of the later ones are written by `write_manifests`."""
    demo = out / "demo" / "demo.yaml"
    chosen = ("--device", device)
    person, paper = out / "person.yaml", out / "paper.yaml"
    dfrf, bench = ("-m", "dubbing"), "dubbing.workshop.bench"
    timed = (str(demo), PERSON)
    return [
        Part("demo", (*dfrf, "demo", str(out / "demo")), 420),
        Part("parity", ("-m", f"{bench}.parity", *timed, str(out / "parity.json"), *chosen), 120),
        Part("bench", ("-m", f"{bench}.benchmark", *timed, str(out / "bench.json"), *chosen), 120),
        Part("person", (*dfrf, "dub", str(person), "--only", PERSON, *chosen), 240),
        Part(
            "base",
            (*dfrf, "train-base", str(demo), "--out", str(out / "base.safetensors"), *chosen),
            180,
        ),
        Part(
            "paper",
            (*dfrf, "train-base", str(paper), "--out", str(out / "paper.safetensors"), *chosen),
        ),
    ]


def write_manifests(out: Path) -> None:
    """Manifests of the demo's person: with 1,000 steps, and with the published method."""
    source = out / "demo" / "source"
    settings: dict[str, dict[str, object]] = {
        "person": {"finetune": {"iterations": 1000}},
        "paper": {"preset": "paper"},
    }
    for name, own in settings.items():
        consent = {"by": "a synthetic person: nobody is on film", "reference": "the demo"}
        person = {"clip": str(source / "clip.mp4"), "seconds": 13, "consent": consent, **own}
        manifest = {
            "version": 1,
            "output": str(out / name),
            "identities": {PERSON: person},
            "dubs": [{"name": "it", "identity": PERSON, "audio": str(source / "italian.wav")}],
        }
        atomic_write_json(out / f"{name}.yaml", manifest)  # JSON is YAML, too


def run(part: Part, out: Path, seconds: float) -> Outcome:
    """Runs a part for so many seconds at most; it is asked to stop, and then stopped."""
    log = out / f"{part.name}.log"
    began, gib, how = time.monotonic(), 0.0, DONE
    with log.open("ab") as written:
        process = subprocess.Popen(
            [sys.executable, *part.call], stdout=written, stderr=subprocess.STDOUT
        )
        while process.poll() is None:
            gib = max(gib, memory_in_use())
            if time.monotonic() - began > seconds:
                how = STOPPED
                process.terminate()
                try:
                    process.wait(END)
                except subprocess.TimeoutExpired:
                    process.kill()
            time.sleep(EVERY if how == DONE else 0)
    if how == DONE and process.returncode:
        how = FAILED
    lines = log.read_text(errors="replace").strip().splitlines()
    took = round(time.monotonic() - began, 1)
    return Outcome(part.name, how, took, round(gib, 2), lines[-1].strip() if lines else "")


def memory_in_use() -> float:
    """GiB of the GPU in use; 0 without one."""
    if not torch.cuda.is_available():
        return 0.0
    free, total = torch.cuda.mem_get_info()
    return (total - free) / 2**30


def run_all(parts: Sequence[Part], out: Path, minutes: float) -> list[Outcome]:
    """Runs those parts that are not done, one after another, and writes the table after each."""
    out.mkdir(parents=True, exist_ok=True)
    until = time.monotonic() + 60 * minutes
    outcomes = []
    for part in parts:
        record = out / f"{part.name}.outcome.json"
        known = json_records.read(record, Outcome, "outcome") if record.is_file() else None
        if known is None or known.how != DONE:
            left = until - time.monotonic()
            if left <= 0:
                break
            known = run(part, out, min(part.limit, left))
            atomic_write_json(record, asdict(known))
        outcomes.append(known)
        atomic_write_text(out / "table.md", table(outcomes))
    return outcomes


def table(outcomes: Sequence[Outcome]) -> str:
    """Outcomes as a table in Markdown."""
    rows = [
        f"| {o.name} | {o.how} | {o.seconds:.0f} | {o.gib:.1f} | {o.said.replace('|', '/')} |"
        for o in outcomes
    ]
    head = "| part | how it ended | s | GiB in use at most | last line |\n|---|---|---|---|---|\n"
    return head + "\n".join(rows) + "\n"


def main() -> None:
    """Runs all parts, and prints the table; exit code 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("out", type=Path)
    parser.add_argument("--minutes", type=float, default=MINUTES)
    parser.add_argument("--device", default="cuda", choices=("cuda", "cpu"))
    arguments = parser.parse_args()
    if arguments.device == "cuda" and not torch.cuda.is_available():
        parser.error("torch sees no GPU here; --device cpu tries the parts without one")
    out = arguments.out.resolve()
    write_manifests(out)
    outcomes = run_all(parts_of(out, arguments.device), out, arguments.minutes)
    print(table(outcomes))
    raise SystemExit(any(outcome.how == FAILED for outcome in outcomes))


if __name__ == "__main__":
    main()
