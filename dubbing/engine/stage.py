"""A stage: a folder of results with a record, written last, of how they were made.

A stage is done only if its record holds: same version, parameters and inputs, and every output
as it was. ``Stage.changes`` lists what does not hold. Work in progress lives in a sibling folder
named after the key (a digest of version, parameters and inputs): a rerun with the same key goes on
there, other settings never pick it up, and the last good result stays until the new one is whole.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ConfigDict
from typing_extensions import TypedDict

from dubbing import json_records
from dubbing.errors import DubbingError
from dubbing.files import PARTIAL, digest_data, digest_file, while_unchanged

RECORD = "stage.json"


class Output(TypedDict):
    """A file that a stage made."""

    bytes: int
    digest: str


class Record(TypedDict):
    """What of a stage's record is read again."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    version: str
    key: str
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
        parts: of that work, which can be done before it, at once and by several machines: name ->
            called with the same folder. See `dubbing.engine.part`.
    """

    name: str
    folder: Path
    version: str
    parameters: Mapping[str, Any]
    inputs: Mapping[str, Path | Stage]
    produce: Produce = field(repr=False, compare=False)
    parts: Mapping[str, Produce] = field(default_factory=dict, repr=False, compare=False)

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

    def fingerprint(self) -> str:
        """All `fingerprints` in one."""
        return digest_data(self.fingerprints())

    def fingerprints(self) -> dict[str, str]:
        """Tell whether two processes mean the same, and what differs where they do not.

        Its code, each of its parameters, and all files that it goes back to.
        """
        files = [self.name, self.digests(), {str(k): v for k, v in self.sources().items()}]
        meant = {"code": self.version, "files": files, **self.parameters}
        return {name: digest_data(value)[:12] for name, value in meant.items()}

    def record(self, folder: Path | None = None) -> Record | None:
        """The record of a finished run, or None: one of another shape is no record."""
        try:
            return json_records.read(
                (folder or self.folder) / RECORD, Record, f"record of {self.name}"
            )
        except DubbingError:
            return None

    def partial(self) -> Path:
        """Where work in progress with the present settings lives."""
        return self.folder.with_name(f"{self.folder.name}{PARTIAL}{self.key()[:12]}")

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


def digest_of(path: Path) -> str:
    """Digest of a file, read once as long as it does not change; '' where there is none."""
    try:
        regular = stat.S_ISREG(os.stat(path).st_mode)
    except FileNotFoundError:
        return ""
    return _digest(path) if regular else ""  # a pipe in its place would block whoever reads it


@while_unchanged(65536)
def _digest(path: Path) -> str:
    return digest_file(path)
