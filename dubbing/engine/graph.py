"""Jobs: what one identity or one dub needs done; and the graph of all their stages."""

from __future__ import annotations

from dataclasses import dataclass

from dubbing.engine.stage import Stage
from dubbing.errors import DubbingError


@dataclass(frozen=True)
class Job:
    """One identity or one dub: its stages in order.

    Attributes:
        kind: ``identity`` or ``dub``.
        waits_for: name of the identity a dub needs; '' for an identity.
        blocked: why it cannot be done at all (a damaged file, speech too long), known beforehand.
    """

    kind: str
    name: str
    stages: dict[str, Stage]
    waits_for: str = ""
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


@dataclass(frozen=True)
class Node:
    """One stage of one job in the graph.

    Attributes:
        rank: its place in the order of a run that does one at a time.
        needs: keys of the stages whose results it reads.
    """

    job: Job
    stage: Stage
    rank: int
    needs: tuple[str, ...]

    @property
    def key(self) -> str:
        """``identity/host/prepare``: names the node."""
        return f"{self.job.label}/{self.stage.name}"


def nodes(jobs: Jobs) -> dict[str, Node]:
    """The graph of the stages of all jobs that can be done, by key.

    Ranked by kind of stage, one kind over all jobs and then the next: what many wait for comes
    first, and one large model is in memory at a time.
    """
    found: dict[str, Node] = {}
    keys: dict[str, str] = {}  # folder -> key of the stage that fills it
    for some in (jobs.identities, jobs.dubs):
        sound = [job for job in some.values() if not job.blocked]
        for name in dict.fromkeys(name for job in sound for name in job.stages):
            for job in sound:
                if stage := job.stages.get(name):
                    sources = [s for s in stage.inputs.values() if isinstance(s, Stage)]
                    needs = tuple(keys[f] for s in sources if (f := str(s.folder)) in keys)
                    node = Node(job, stage, len(found), needs)
                    found[node.key] = node
                    keys[str(stage.folder)] = node.key
    return found
