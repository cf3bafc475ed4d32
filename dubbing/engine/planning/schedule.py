"""Time that a graph of stages takes on several workers, from the time of each stage."""

import heapq
from collections.abc import Mapping

from ..graph.graph import Node
from ..graph.stage_id import StageId


def simulate(
    graph: Mapping[StageId, Node], seconds: Mapping[StageId, float], workers: int
) -> float:
    """Seconds of a run in which every worker does what is ready, as `runner`: lowest rank first.

    Args:
        seconds: of each stage; none of those that take no time.
    """
    unmet = {key: len(set(node.needs)) for key, node in graph.items()}
    readers: dict[StageId, list[StageId]] = {key: [] for key in graph}
    for key, node in graph.items():
        for source in set(node.needs):
            readers[source].append(key)
    ready = [(graph[key].rank, key) for key, count in unmet.items() if not count]
    heapq.heapify(ready)
    running: list[tuple[float, StageId]] = []
    now = 0.0
    while ready or running:
        while ready and len(running) < workers:
            _, key = heapq.heappop(ready)
            heapq.heappush(running, (now + seconds.get(key, 0.0), key))
        now, key = heapq.heappop(running)
        for reader in readers[key]:
            unmet[reader] -= 1
            if not unmet[reader]:
                heapq.heappush(ready, (graph[reader].rank, reader))
    return now


def critical_path(
    graph: Mapping[StageId, Node], seconds: Mapping[StageId, float]
) -> tuple[StageId, ...]:
    """The longest chain, the first first. The graph has a stage after those that it needs."""
    ends: dict[StageId, float] = {}
    before: dict[StageId, StageId | None] = {}
    for key, node in graph.items():
        last = max(node.needs, key=ends.__getitem__, default=None)
        ends[key] = seconds.get(key, 0.0) + (0.0 if last is None else ends[last])
        before[key] = last
    at = max(ends, key=ends.__getitem__, default=None)
    chain = []
    while at is not None:
        chain.append(at)
        at = before[at]
    return tuple(reversed(chain))
