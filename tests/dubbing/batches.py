"""Batches of stand-ins: how they are written down, run, and watched."""

from __future__ import annotations

from pathlib import Path

from dubbing.batch import batch
from dubbing.engine.graph import Job
from dubbing.engine.outcome import Failure
from dubbing.engine.runner import Options
from dubbing.engine.stage import Stage
from dubbing.manifest.manifest import load
from tests import clips

ROOT = Path(__file__).resolve().parents[2]


class Listener:
    """Remembers which stages ran."""

    def __init__(self) -> None:
        self.began: list[str] = []

    def overall(self, done: int, total: int) -> None:
        assert 0 <= done <= total

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        self.began.append(f"{job.name}:{stage.name}")

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        assert 0 <= share <= 1

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        pass


def manifest_of(footage: Path, folder: Path, people: dict[str, str], extra: str = "") -> Path:
    lines = ["version: 1", "output: out", "identities:"]
    lines += [
        f"  {name}: {{clip: {footage / clip}, seconds: 1, consent: {clips.CONSENT}}}"
        for name, clip in people.items()
    ]
    lines += ["dubs:"]
    lines += [f"  - {{identity: {name}, audio: {footage / 'it.wav'}{extra}}}" for name in people]
    path = folder / "m.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path


def dub(path: Path, **options: object) -> tuple[batch.Result, list[str]]:
    listener = Listener()
    only = options.pop("only", ())
    result = batch.dub(load(path), listener, Options(**options), only=only)  # type: ignore[arg-type]
    return result, listener.began
