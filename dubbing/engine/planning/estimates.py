"""Time, disk and memory that a run needs, before it starts.

A stage's time grows with its amount; see `Stage.amount`. How long one unit takes is measured on
stages that are done; else it is known of this machine; else the stage has a typical rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from ..disk.file_digests import digest_of
from ..graph.graph import Jobs, Node, nodes
from ..graph.stage import Rate, Record, Stage
from ..graph.stage_id import StageId
from .planner import Row, to_do
from .schedule import longest_chain, simulate


@dataclass(frozen=True)
class Estimate:
    """Needs of a run.

    Attributes:
        seconds: of one process; two: of two side by side; longest: of any number, the chain of
            stages that need one another.
        disk: bytes of the results.
        memory: bytes of the process that needs most.
        elsewhere: whether the time of a stage is what it took on another machine.
    """

    seconds: float
    two: float
    longest: float
    disk: float
    memory: float
    elsewhere: bool = False


def measured(graph: Mapping[StageId, Node]) -> dict[str, Rate]:
    """Rates of stages that are done with the files and parameters of now: medians by kind of rate.

    See `Stage.rate_kind`.
    """
    found: dict[str, list[Rate]] = {}
    for stage in (node.stage for node in graph.values()):
        record, many = stage.record(), stage.amount()
        if record is not None and many and _as_large(stage, record):
            size = sum(output["bytes"] for output in record["outputs"].values())
            rate = Rate(record["seconds"] / many, size / many)
            found.setdefault(stage.rate_kind(), []).append(rate)
    return {
        name: Rate(median(r.seconds for r in rates), median(r.bytes for r in rates))
        for name, rates in found.items()
    }


def _as_large(stage: Stage, record: Record) -> bool:
    """Whether a record is of the files and parameters of now: others tell nothing of this run."""
    files = {name: digest_of(path) for name, path in stage.inputs.items() if isinstance(path, Path)}
    same = all(record["inputs"].get(name, digest) == digest for name, digest in files.items())
    return same and record["parameters"] == dict(stage.parameters)


def expected(jobs: Jobs, known: Mapping[str, Rate], *, parts: bool) -> dict[StageId, float]:
    """Seconds that the stages of a run will take.

    Args:
        known: rates of this machine, by kind of rate.
        parts: whether stages are done in parts, where they have any.
    """
    rates = {**known, **measured(nodes(jobs))}
    return {
        name: _rate(node.stage, rates).seconds * node.stage.amount()
        for name, node in nodes(jobs, split=lambda stage: parts).items()
        if not (parts and node.stage.parts())
    }


def _rate(stage: Stage, rates: Mapping[str, Rate]) -> Rate:
    return rates.get(stage.rate_kind(), stage.typical_rate())


def estimate(jobs: Jobs, rows: list[Row], known: Mapping[str, Rate]) -> Estimate:
    """Needs of a run of these jobs.

    Args:
        rows: from `planner.rows`.
        known: rates of this machine, by kind of rate.
    """
    wanted, graph = to_do(rows), nodes(jobs, split=lambda stage: True)
    rates = {**known, **measured(nodes(jobs))}
    seconds, disk, memory, elsewhere = {}, 0.0, 0.0, False
    for name, stage in ((name, node.stage) for name, node in graph.items()):
        if name.whole in wanted and not stage.parts():  # its parts take the time of a stage
            rate, many = _rate(stage, rates), stage.amount()
            seconds[name], disk = rate.seconds * many, disk + rate.bytes * many
            memory = max(memory, stage.memory())
            elsewhere |= stage.rate_kind() not in rates
    two, longest = simulate(graph, seconds, 2), longest_chain(graph, seconds)
    return Estimate(sum(seconds.values()), two, longest, disk, memory, elsewhere)
