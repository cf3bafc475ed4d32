"""Jobs: what one identity or one dub needs done, stage by stage."""

from __future__ import annotations

from dataclasses import dataclass

from dubbing.engine.stage import Stage
from dubbing.errors import DubbingError


@dataclass(frozen=True)
class Job:
    """One identity or one dub: its stages in order.

    Attributes:
        kind: ``identity`` or ``dub``.
        stages: by what each is of, as ``render`` or ``render host_0000010-0000050``; several may
            be of one kind, which is the stage's name.
        waits_for: names of the identities a dub needs.
        blocked: why it cannot be done at all (a damaged file, speech too long), known beforehand.
    """

    kind: str
    name: str
    stages: dict[str, Stage]
    waits_for: tuple[str, ...] = ()
    blocked: DubbingError | None = None

    @property
    def label(self) -> str:
        """``identity/host``, ``dub/host_it``: identities and dubs may share a name."""
        return f"{self.kind}/{self.name}"


@dataclass(frozen=True)
class Jobs:
    """All jobs of a run."""

    identities: dict[str, Job]
    dubs: dict[str, Job]

    def all(self) -> list[Job]:
        """Identities first: dubs wait for them."""
        return [*self.identities.values(), *self.dubs.values()]
