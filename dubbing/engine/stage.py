"""A stage: a folder of results with a record, written last, of how they were made.

A stage is done only if its record holds: same version, parameters and inputs, and every output
as it was. ``Stage.changes`` says what does not hold. Work in progress lives in a sibling folder
named after the key (a digest of version, parameters and inputs): a rerun with the same key goes on
there, other settings never pick it up, and the last good result stays until the new one is whole.
"""

from __future__ import annotations

import os
import shutil
import stat
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from pydantic import ConfigDict
from typing_extensions import TypedDict

from dubbing import json_records as kept
from dubbing.errors import DubbingError, StageError
from dubbing.files import atomic_write_json, digest_data, digest_file, sync_file
from dubbing.media import ffmpeg

RECORD = "stage.json"
TEMPORARY = ".*.tmp*"  # names given by files.atomic_path
PACKAGES = ("dfrf", "torch", "numpy")


class Output(TypedDict):
    """A file that a stage made."""

    bytes: int
    digest: str


class Record(TypedDict):
    """What of a stage's record is read again."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    version: str
    parameters: dict[str, Any]
    inputs: dict[str, str]
    outputs: dict[str, Output]
    seconds: float


Progress = Callable[[str, float], None]
Produce = Callable[[Path, Progress], None]


@dataclass(frozen=True)
class Stage:
    """One piece of work.

    Attributes:
        name: what is done, as ``--force`` names it: prepare, finetune, render, ...
        folder: where its results lie.
        version: of the code that does it; see `code_version`.
        parameters: plain data the results depend on.
        inputs: what it reads: name -> a file, or an earlier stage.
        produce: called with an empty or half-done folder to fill.
    """

    name: str
    folder: Path
    version: str
    parameters: Mapping[str, Any]
    inputs: Mapping[str, Path | Stage]
    produce: Produce = field(repr=False, compare=False)

    def digests(self) -> dict[str, str]:
        """Digest of every input, as it is now."""
        return {
            name: source.result() if isinstance(source, Stage) else digest_of(source)
            for name, source in self.inputs.items()
        }

    def sources(self) -> dict[Path, str]:
        """Digest of every file that the results go back to, those of earlier stages included."""
        found: dict[Path, str] = {}
        for source in self.inputs.values():
            found |= source.sources() if isinstance(source, Stage) else {source: digest_of(source)}
        return found

    def ancestors(self) -> set[Path]:
        """Folders of all stages that its results go back to."""
        found: set[Path] = set()
        for source in self.inputs.values():
            if isinstance(source, Stage):
                found |= {source.folder, *source.ancestors()}
        return found

    def result(self) -> str:
        """Digest of everything the stage made; '' if it is not done."""
        record = self.record()
        return digest_data(record["outputs"]) if record else ""

    def key(self) -> str:
        """Names one way to do this stage: the same key gives the same results."""
        return digest_data([self.name, self.version, dict(self.parameters), self.digests()])

    def record(self, folder: Path | None = None) -> Record | None:
        """The record of a finished run, or None: one of another shape is no record."""
        try:
            return kept.read((folder or self.folder) / RECORD, Record, f"record of {self.name}")
        except DubbingError:
            return None

    def partial(self) -> Path:
        """Where work in progress with the present settings lives."""
        return self.folder.with_name(f"{self.folder.name}.partial-{self.key()[:12]}")

    def changes(self) -> list[str]:
        """Why the results do not hold, one reason a line; empty when they do."""
        record = self.record()
        if record is None:
            if os.path.lexists(self.folder / RECORD):
                return ["its record is damaged"]
            started = self._inputs_ready() and self.partial().is_dir()
            return ["interrupted: goes on where it stopped" if started else "not made yet"]
        reasons = []
        if record["version"] != self.version:
            reasons.append("the code of the stage changed")
        for name in sorted({*record["parameters"], *self.parameters}):
            before, now = record["parameters"].get(name), self.parameters.get(name)
            if before != now:
                reasons.append(f"{name}: {before} before, {now} now")
        digests = self.digests()
        changed = [
            n for n in {*record["inputs"], *digests} if record["inputs"].get(n) != digests.get(n)
        ]
        reasons += [f"{name} changed" for name in sorted(changed)]
        for name, made in record["outputs"].items():
            path = self.folder / name
            if not path.is_file():
                reasons.append(f"{name} is gone")
            elif path.stat().st_size != made["bytes"] or digest_of(path) != made["digest"]:
                reasons.append(f"{name} was altered")
        return reasons

    def _inputs_ready(self) -> bool:
        return all(not isinstance(s, Stage) or s.record() for s in self.inputs.values())


def run_stage(
    stage: Stage,
    progress: Progress,
    *,
    force: bool = False,
    began: Mapping[Path, str] | None = None,
) -> bool:
    """Bring a stage up to date. True if there was anything to do.

    Args:
        began: digests of files as they were when the run began: nothing is made from others.

    Raises:
        DubbingError: it failed. The last good result and the partial work stay.
        StageError: a file that its results go back to changed; what was made of it is gone.
    """
    recover(stage)
    if not force and not stage.changes():
        return False
    key, digests, sources = stage.key(), stage.digests(), stage.sources()
    _unchanged(stage, sources, {**sources, **(began or {})})
    partial = stage.partial()
    if force:
        shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True, exist_ok=True)
    for torn in partial.rglob(TEMPORARY):
        torn.unlink()  # half-written files of a run that was killed
    if stage.record(partial) is None:
        started = time.perf_counter()
        try:
            stage.produce(partial, progress)
        except Exception:
            _unchanged(stage, stage.sources(), sources, partial)  # what it raised follows from that
            raise
        _unchanged(stage, stage.sources(), sources, partial)
        if stage.digests() != digests:
            raise StageError("a stage before it changed meanwhile", stage.name, "run it again")
        _seal(stage, partial, key=key, digests=digests, seconds=time.perf_counter() - started)
    _swap(stage, partial)
    for leftover in stage.folder.parent.glob(f"{stage.folder.name}.partial-*"):
        shutil.rmtree(leftover)  # of other settings
    return True


def _unchanged(
    stage: Stage, now: Mapping[Path, str], before: Mapping[Path, str], partial: Path | None = None
) -> None:
    """Raises StageError, and removes the partial work, where a file is not what it was before."""
    for path, digest in now.items():
        if before[path] != digest:
            if partial is not None:  # else it would be gone on with, should the old file return
                shutil.rmtree(partial, ignore_errors=True)
            what = f"{path.name} changed while the run was going on"
            raise StageError(what, stage.name, "run it again")


def recover(stage: Stage) -> None:
    """Bring the last good result back if a kill came while it was being replaced."""
    old = _old(stage)
    if stage.folder.exists():
        shutil.rmtree(old, ignore_errors=True)
    elif old.exists():
        old.rename(stage.folder)


def _seal(stage: Stage, folder: Path, *, key: str, digests: dict[str, str], seconds: float) -> None:
    """Flush every output to the disk, then write the record."""
    outputs = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.name != RECORD):
        sync_file(path)
        name = path.relative_to(folder).as_posix()
        outputs[name] = {"bytes": path.stat().st_size, "digest": digest_file(path)}
    record = {
        "stage": stage.name,
        "version": stage.version,
        "key": key,
        "parameters": dict(stage.parameters),
        "inputs": digests,
        "outputs": outputs,
        "versions": {**versions(), "ffmpeg": ffmpeg.version()},
        "seconds": round(seconds, 2),
    }
    atomic_write_json(folder / RECORD, record)


def _swap(stage: Stage, partial: Path) -> None:
    old = _old(stage)
    shutil.rmtree(old, ignore_errors=True)
    if stage.folder.exists():
        stage.folder.rename(old)
    partial.rename(stage.folder)
    sync_file(stage.folder.parent)
    shutil.rmtree(old, ignore_errors=True)


def _old(stage: Stage) -> Path:
    return stage.folder.with_name(f"{stage.folder.name}.old")


def digest_of(path: Path) -> str:
    """Digest of a file, read once as long as it does not change; '' where there is none."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        return ""
    if not stat.S_ISREG(status.st_mode):
        return ""  # a pipe that came in its place would be waited for
    return _digest(path, status.st_size, status.st_mtime_ns, status.st_ino)


@lru_cache(maxsize=65536)
def _digest(path: Path, _size: int, _changed: int, _inode: int) -> str:
    return digest_file(path)


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Versions of what the results depend on, without importing any of it."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found
