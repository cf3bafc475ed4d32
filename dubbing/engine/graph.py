"""Jobs: what one identity or one dub needs done; and the graph of all their stages."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dubbing.engine.part import Part, part_of
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

    def name_of(self, stage: Stage) -> str:
        """What it calls a stage: its kind, and which one it is where there are several."""
        whole, of = (stage.whole, f" {stage.of}") if isinstance(stage, Part) else (stage, "")
        return next((name for name, own in self.stages.items() if own is whole), stage.name) + of

    def stage(self, name: str) -> Stage:
        """The stage, or the part of one, that it calls so.

        Raises:
            KeyError: it has none.
        """
        if name in self.stages:
            return self.stages[name]
        whole, _, of = name.rpartition(" ")
        return part_of(self.stages[whole], of)


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
        name: what its job calls it.
        rank: its place in the order of a run that does one at a time.
        needs: keys of the stages whose results it reads.
    """

    job: Job
    name: str
    stage: Stage
    rank: int
    needs: tuple[str, ...]

    @property
    def key(self) -> str:
        """``identity/host/prepare``, ``dub/it/render host_0000010-0000050``: names the node."""
        return f"{self.job.label}/{self.name}"


def kind_of(key: str) -> str:
    """The kind of the stage that a node's key names."""
    return key.rpartition("/")[2].partition(" ")[0]


def nodes(jobs: Jobs, split: Callable[[Stage], bool] = lambda stage: False) -> dict[str, Node]:
    """The graph of the stages of all jobs that can be done, by key, each after what it needs.

    A stage that is split stands there after its parts, which need what it needs.

    Ranked by kind of stage, one kind over all jobs and then the next: what many wait for comes
    first, and one large model is in memory at a time.
    """
    found: dict[str, Node] = {}
    keys: dict[Path, str] = {}  # folder -> key of the stage that fills it
    for some in (jobs.identities, jobs.dubs):
        sound = [
            (job, name, stage)
            for job in some.values()
            if not (job.blocked or any(jobs.identities[p].blocked for p in job.waits_for))
            for name, stage in job.stages.items()
        ]
        for kind in dict.fromkeys(stage.name for _, _, stage in sound):
            for job, name, stage in sound:
                if stage.name == kind:
                    sources = [s for s in stage.inputs.values() if isinstance(s, Stage)]
                    needs = tuple(dict.fromkeys(keys[s.folder] for s in sources))
                    parts = []
                    for of in stage.parts if split(stage) else ():
                        part = part_of(stage, of)
                        node = Node(job, job.name_of(part), part, len(found), needs)
                        found[node.key] = node
                        parts.append(node.key)
                    node = Node(job, name, stage, len(found), (*needs, *parts))
                    found[node.key] = node
                    keys[stage.folder] = node.key
    return found
