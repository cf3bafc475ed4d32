"""Jobs: the stages of one person or one film; and the graph of the stages of all jobs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar, cast

from ..errors import ExplainedError
from .part import Part
from .stage import Stage
from .stage_id import StageId

AnyStage = TypeVar("AnyStage", bound=Stage)


@dataclass
class Job:
    """The stages of one thing to be made, in their order.

    Attributes:
        kind, name: of the thing, as ``dub`` and ``host_it``: things of two kinds may share a name.
        folder: where its stages lie, each in a folder of its kind's name.
        parts: folder inside of that for the stages of which there are several of a kind.
        waits_for: labels of the jobs whose results it reads.
        blocked: why it cannot be done at all, known beforehand.
    """

    kind: str
    name: str
    folder: Path
    parts: str = "parts"
    waits_for: tuple[str, ...] = ()
    blocked: ExplainedError | None = None
    stages: dict[StageId, Stage] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Names it among all jobs: ``dub/host_it``."""
        return f"{self.kind}/{self.name}"

    def add(self, stage: AnyStage, of: str = "") -> AnyStage:
        """Add the next stage; gives it with its name and folder.

        Args:
            of: which one it is, where there are several of a kind.
        """
        folder = self.folder / self.parts / of if of else self.folder
        placed = replace(stage, id=StageId(self.label, stage.kind, of), folder=folder / stage.kind)
        self.stages[placed.id] = placed
        return placed

    def stage(self, kind: type[AnyStage], of: str = "") -> AnyStage:
        """The stage of a class.

        Args:
            of: which one, where there are several.

        Raises:
            KeyError: it has none.
        """
        return cast(AnyStage, self.stages[StageId(self.label, kind.kind, of)])

    def all_of(self, kind: type[AnyStage]) -> list[AnyStage]:
        """All stages of a class."""
        return [stage for stage in self.stages.values() if isinstance(stage, kind)]

    def find(self, name: StageId) -> Stage:
        """A stage, or a part of one.

        Raises:
            KeyError: it has none.
        """
        whole = self.stages[name.whole]
        return Part.of(whole, name.part) if name.part else whole


@dataclass(frozen=True)
class Jobs:
    """All jobs of a run, each after those that it waits for."""

    by_label: Mapping[str, Job]

    @classmethod
    def of(cls, jobs: Iterable[Job]) -> Jobs:
        """Jobs in their order."""
        return cls({job.label: job for job in jobs})

    def all(self) -> list[Job]:
        """All of them, in their order."""
        return [*self.by_label.values()]

    def named(self, kind: str) -> dict[str, Job]:
        """The jobs of a kind, by name."""
        return {job.name: job for job in self.all() if job.kind == kind}

    def blocked(self, job: Job) -> ExplainedError | None:
        """Why a job, or one that it waits for, cannot be done; None where all can."""
        errors = (one.blocked for one in (job, *(self.by_label[of] for of in job.waits_for)))
        return next(filter(None, errors), None)


@dataclass(frozen=True)
class Node:
    """One stage of one job in the graph.

    Attributes:
        rank: its place in the order of a run that does one at a time.
        needs: the stages whose results it reads.
    """

    job: Job
    stage: Stage
    rank: int
    needs: tuple[StageId, ...]


def nodes(jobs: Jobs, split: Callable[[Stage], bool] = lambda stage: False) -> dict[StageId, Node]:
    """The graph of the stages of all jobs that can be done, each after those that it needs.

    A stage that is split stands there after its parts, which need the same stages.

    Ranked by kind of stage, one kind over all jobs of a kind and then the next: results that many
    wait for come first, and one large model is in memory at a time.
    """
    graph: dict[StageId, Node] = {}
    for job_kind in dict.fromkeys(job.kind for job in jobs.all()):
        some = [job for job in jobs.named(job_kind).values() if jobs.blocked(job) is None]
        stages = [(job, stage) for job in some for stage in job.stages.values()]
        for kind in dict.fromkeys(stage.kind for _, stage in stages):
            for job, stage in stages:
                if stage.kind == kind:
                    sources = [s.id for s in stage.inputs.values() if isinstance(s, Stage)]
                    needs, parts = tuple(dict.fromkeys(sources)), []
                    for name in stage.parts() if split(stage) else ():
                        part = Part.of(stage, name)
                        graph[part.id] = Node(job, part, len(graph), needs)
                        parts.append(part.id)
                    graph[stage.id] = Node(job, stage, len(graph), (*needs, *parts))
    return graph
