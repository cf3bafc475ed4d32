"""Names of stages."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, order=True)
class StageId:
    """Names a stage of a run.

    Attributes:
        job: label of its job, as ``dub/host_it``.
        kind: of the stage, as ``render``.
        of: which one it is, where a job has several of a kind.
        part: of its work; see `part`.
    """

    job: str = ""
    kind: str = ""
    of: str = ""
    part: str = ""

    @property
    def name(self) -> str:
        """The stage inside its job, as people read it: ``render host_0000010-0000050``."""
        return " ".join(filter(None, (self.kind, self.of, self.part)))

    @property
    def whole(self) -> StageId:
        """The stage that this is a part of, or itself."""
        return replace(self, part="")

    def __str__(self) -> str:
        return f"{self.job}/{self.name}"
