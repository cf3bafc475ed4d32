"""Batches of stand-ins: how they are written down, run, and watched."""

from __future__ import annotations

from pathlib import Path

from dubbing.batch import batch
from dubbing.engine.running.executors import Executor
from dubbing.engine.running.runner import Options
from dubbing.manifest.manifest import load
from tests import clips
from tests.dubbing.engine.listener import Listener

ROOT = Path(__file__).resolve().parents[2]


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


def dub(
    path: Path,
    *,
    only: tuple[str, ...] = (),
    draft: bool = False,
    listener: Listener | None = None,
    executor: Executor | None = None,
    **options: object,
) -> tuple[batch.Result, list[str]]:
    """Run a batch, or make its drafts; gives its result, and the stages that ran."""
    listener = listener or Listener()
    production = load(path)
    planned = batch.begin(production, only=only, draft=draft)
    chosen = Options(**options)  # type: ignore[arg-type]
    make = batch.drafts if draft else batch.dub
    return make(production, planned, listener, chosen, executor), listener.began
