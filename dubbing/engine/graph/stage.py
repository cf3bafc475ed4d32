"""A stage: one piece of work that declares what it depends on, and the folder of its results.

    @dataclass(frozen=True, kw_only=True)
    class Render(Stage):
        model: Stage          # an input: another stage, whose results are read
        audio: Path           # an input: a file, whose content counts and whose path does not
        first: int            # a parameter: plain data
        device: Setting[str]  # a setting: no byte of the results depends on it

        def run(self, out: Path, progress: Progress) -> None: ...

Files and stages count as inputs wherever they stand in a field: in tuples, mappings and
dataclasses, too. Everything else in there is a parameter, unless it is marked as a setting. The
code of the class's module, and of all modules that it imports, counts as well. So a stage that
uses its fields alone cannot depend on anything that is not part of its key, but for its settings.

A stage is done only if its record holds: same code, parameters and inputs, and every output as it
was. ``Stage.changes`` lists what does not hold. Work in progress lives in a sibling folder named
after the key (a digest of code, parameters and inputs): a rerun with the same key continues there,
other settings never pick it up, and the last good result stays until the new one is whole.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import ConfigDict
from typing_extensions import TypedDict

from ..disk import json_records
from ..disk.file_digests import digest_of
from ..disk.files import PARTIAL, digest_data
from .code_version import code_version
from .fields import INPUT, Setting, counted, differences, without_inputs
from .stage_id import StageId

RECORD = "stage.json"
Progress = Callable[[str, float], None]  # called with a message, and the share of the work done
ReportShare = Callable[[float], None]  # called with the share of the work done


class Output(TypedDict):
    """A file that a stage made."""

    bytes: int
    digest: str


class Record(TypedDict):
    """The part of a stage's record that is read again."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    version: str
    key: str
    parameters: dict[str, Any]
    inputs: dict[str, str]
    outputs: dict[str, Output]
    seconds: float


@dataclass(frozen=True)
class Rate:
    """Cost of one unit of a stage's amount: seconds, and bytes of its results."""

    seconds: float
    bytes: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Base class of stages; see the module.

    Attributes:
        id, folder: given by the job that it is added to; see `graph.Job.add`.
        last: while it runs: a folder with whole results of other settings, of which it may take
            over what would be the same; None where all is to be made anew.
        kind: of the class: its name in lower case, ``refine_poses``, as ``--force`` takes it.
        packages: top packages whose code counts.
        without_effect: modules of these whose code does not count, with all that lies in them.
        typical: cost of one unit of `amount` where nothing is measured.
    """

    id: Setting[StageId] = field(default=StageId(), compare=False)
    folder: Setting[Path] = field(default=Path(), compare=False)
    last: Setting[Path | None] = field(default=None, compare=False)

    kind: ClassVar[str]
    packages: ClassVar[tuple[str, ...]] = ()
    without_effect: ClassVar[tuple[str, ...]] = ()
    typical: ClassVar[Rate] = Rate(1.0)

    def __init_subclass__(cls) -> None:
        cls.kind = re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()

    def run(self, out: Path, progress: Progress) -> None:
        """Fill a folder with the results.

        Args:
            out: empty, or as an interrupted run left it.
        """
        raise NotImplementedError

    def amount(self) -> float:
        """How much work it is: what the time that it takes grows with."""
        return 1.0

    def memory(self) -> float:
        """Bytes that its process needs."""
        return 0.0

    def rate_kind(self) -> str:
        """Name of the rate that it goes by: stages of one name take the same time a unit."""
        return self.kind

    def typical_rate(self) -> Rate:
        """Cost of one unit of its amount where nothing is measured."""
        return self.typical

    def needs_gpu(self) -> bool:
        """Whether only a machine with a GPU can do it."""
        return False

    def parts(self) -> Mapping[str, Self]:
        """The same work in parts that several machines can do at once; none by default.

        Each differs from the whole in settings alone. See `part`.
        """
        return {}

    @classmethod
    def versions(cls) -> dict[str, str]:
        """Versions of packages and programs, for the record."""
        return {}

    @property
    def version(self) -> str:
        """Digest of the code that does the work."""
        return code_version(type(self).__module__, self.packages, self.without_effect)

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Plain data that the results depend on, by field."""
        return self._declared[1]

    @property
    def inputs(self) -> Mapping[str, Path | Stage]:
        """The files and stages that it reads, by field, and place in the field."""
        return self._declared[0]

    @cached_property
    def _declared(self) -> tuple[dict[str, Path | Stage], dict[str, Any]]:
        """Inputs and parameters, as its fields hold them."""
        inputs: dict[str, Any] = {}
        plain = without_inputs("", counted(self), inputs, (Path, Stage))
        return inputs, {} if plain is INPUT else plain

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

    def ancestors(self) -> set[StageId]:
        """All stages that its results go back to."""
        found: set[StageId] = set()
        for source in self.inputs.values():
            if isinstance(source, Stage):
                found |= {source.id, *source.ancestors()}
        return found

    def result(self) -> str:
        """Digest of everything the stage made; '' if it is not done."""
        record = self.record()
        return digest_data(record["outputs"]) if record else ""

    def key(self) -> str:
        """Names one way to do this stage: the same key gives the same results."""
        return digest_data([self.kind, self.version, dict(self.parameters), self.digests()])

    def fingerprints(self) -> dict[str, str]:
        """Tell whether two processes mean the same, and what differs where they do not.

        Its code, each of its parameters, and all files that it goes back to.
        """
        files = [self.kind, self.digests(), {str(k): v for k, v in self.sources().items()}]
        meant = {"code": self.version, "files": files, **self.parameters}
        return {name: digest_data(value)[:12] for name, value in meant.items()}

    def record(self, folder: Path | None = None) -> Record | None:
        """The record of a finished run, or None: one of another shape is no record."""
        return json_records.read_or(None, (folder or self.folder) / RECORD, Record)

    def partial(self) -> Path:
        """Where work in progress with the present settings lives."""
        return self.folder.with_name(f"{self.folder.name}{PARTIAL}{self.key()[:12]}")

    def whole_result(self) -> Path | None:
        """The folder of the last results, where every file is as it was made."""
        record = self.record()
        return self.folder if record and not self._altered(record) else None

    def changes(self) -> list[str]:
        """Why the results do not hold, one reason a line; empty when they do."""
        record = self.record()
        if record is None:
            if os.path.lexists(self.folder / RECORD):
                return ["its record is damaged"]
            begun = any(self.folder.parent.glob(f"{self.folder.name}{PARTIAL}*"))
            started = begun and self._inputs_ready() and self.partial().is_dir()
            return ["interrupted: goes on where it stopped" if started else "not made yet"]
        reasons = []
        if record["version"] != self.version:
            reasons.append("the code of the stage changed")
        reasons += differences(record["parameters"], self.parameters)
        digests = self.digests()
        changed = [
            n for n in {*record["inputs"], *digests} if record["inputs"].get(n) != digests.get(n)
        ]
        reasons += [f"{name} changed" for name in sorted(changed)]
        return reasons + self._altered(record)

    def _altered(self, record: Record) -> list[str]:
        """Which results are not what they were."""
        reasons = []
        for name, made in record["outputs"].items():
            path = self.folder / name
            if not path.is_file():
                reasons.append(f"{name} is gone")
            elif path.stat().st_size != made["bytes"] or digest_of(path) != made["digest"]:
                reasons.append(f"{name} was altered")
        return reasons

    def _inputs_ready(self) -> bool:
        return all(not isinstance(s, Stage) or s.record() for s in self.inputs.values())
