"""A part of a stage's work, which several machines can do at once.

A part only fills the folder of the stage's work in progress; the stage itself then finds everything
there, and publishes it. A part has a claim of its own. Whoever claims the stage waits for the
claims of its parts, and a part that finds the stage claimed leaves the work to whoever holds it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .fields import Setting
from .stage import Progress, Rate, Stage

MARKS = "*.part.json"  # seconds that parts took, beside their results until the stage is whole


@dataclass(frozen=True, kw_only=True)
class Part(Stage):
    """A part of ``whole``, made under its kind, version, parameters and inputs: under its key.

    Attributes:
        work: the stage with the settings of this part; see `Stage.parts`.
    """

    whole: Setting[Stage]
    work: Setting[Stage]

    @classmethod
    def of(cls, whole: Stage, name: str) -> Part:
        """The part of a stage that has this name.

        Raises:
            KeyError: it has no such part.
        """
        return cls(
            id=replace(whole.id, part=name),
            folder=whole.folder.with_name(f"{whole.folder.name}.{name}"),
            whole=whole,
            work=whole.parts()[name],
        )

    def run(self, out: Path, progress: Progress) -> None:
        replace(self.work, last=self.last).run(out, progress)

    def whole_result(self) -> Path | None:
        return self.whole.whole_result()

    def amount(self) -> float:
        return self.work.amount()

    def memory(self) -> float:
        return self.work.memory()

    def rate_kind(self) -> str:
        return self.whole.rate_kind()

    def typical_rate(self) -> Rate:
        return self.whole.typical_rate()

    def needs_gpu(self) -> bool:
        return self.whole.needs_gpu()

    @property
    def version(self) -> str:
        return self.whole.version

    @property
    def parameters(self) -> Mapping[str, Any]:
        return self.whole.parameters

    @property
    def inputs(self) -> Mapping[str, Path | Stage]:
        return self.whole.inputs

    @property
    def mark(self) -> Path:
        """The file that lies there when the part is done: the seconds it took."""
        return self.partial() / MARKS.replace("*", self.id.part)

    def key(self) -> str:
        return self.whole.key()

    def fingerprints(self) -> dict[str, str]:
        return self.whole.fingerprints()

    def partial(self) -> Path:
        """Where the stage's work in progress lives."""
        return self.whole.partial()

    def changes(self) -> list[str]:
        """Why it has to be done; empty when it is, or when its stage is."""
        reasons = self.whole.changes()
        done = reasons and (self.mark.exists() or self.whole.record(self.partial()) is not None)
        return [] if done else reasons
