"""Time that a graph of stages takes on several workers, from the time of each stage."""

import heapq
from collections.abc import Mapping
from graphlib import TopologicalSorter

from ..graph.graph import Node
from ..graph.stage_id import StageId


def simulate(
    graph: Mapping[StageId, Node], seconds: Mapping[StageId, float], workers: int
) -> float:
    """Seconds of a run in which every worker does what is ready, as `runner`: lowest rank first.

    Args:
        seconds: of each stage; none of those that take no time.
    """
    order = TopologicalSorter({key: node.needs for key, node in graph.items()})
    order.prepare()
    ready: list[tuple[int, StageId]] = []
    running: list[tuple[float, StageId]] = []
    now = 0.0
    while order.is_active():
        for key in order.get_ready():
            heapq.heappush(ready, (graph[key].rank, key))
        while ready and len(running) < workers:
            _, key = heapq.heappop(ready)
            heapq.heappush(running, (now + seconds.get(key, 0.0), key))
        now, key = heapq.heappop(running)
        order.done(key)
    return now


def longest_chain(graph: Mapping[StageId, Node], seconds: Mapping[StageId, float]) -> float:
    """Seconds of the longest chain. The graph has a stage after those that it needs."""
    ends: dict[StageId, float] = {}
    for key, node in graph.items():
        begins = max((ends[source] for source in node.needs), default=0.0)
        ends[key] = begins + seconds.get(key, 0.0)
    return max(ends.values(), default=0.0)
