"""How long a graph of stages takes on so many workers, from how long each stage takes."""

import heapq
from collections.abc import Mapping
from dataclasses import dataclass

from dubbing.engine.graph import Node


@dataclass(frozen=True)
class Schedule:
    """A run that was simulated.

    Attributes:
        seconds: from its start to its end.
        idle: share of the workers' time in which they wait.
        critical: keys of the longest chain of stages, each of which needs the one before it.
    """

    seconds: float
    idle: float
    critical: tuple[str, ...]


def simulate(graph: Mapping[str, Node], seconds: Mapping[str, float], workers: int) -> Schedule:
    """Every worker does what is ready, the lowest rank first, as `dubbing.engine.runner` does.

    Args:
        seconds: of each stage by its key; of none where it takes no time.
    """
    unmet = {key: len(set(node.needs)) for key, node in graph.items()}
    readers: dict[str, list[str]] = {key: [] for key in graph}
    for key, node in graph.items():
        for source in set(node.needs):
            readers[source].append(key)
    ready = [(graph[key].rank, key) for key, count in unmet.items() if not count]
    heapq.heapify(ready)
    running: list[tuple[float, str]] = []
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
    work = sum(seconds.get(key, 0.0) for key in graph)
    idle = 1 - work / (now * workers) if now else 0.0
    return Schedule(now, idle, critical_path(graph, seconds))


def critical_path(graph: Mapping[str, Node], seconds: Mapping[str, float]) -> tuple[str, ...]:
    """Keys of the longest chain, the first first. The graph names a stage after what it needs."""
    ends: dict[str, float] = {}
    before: dict[str, str] = {}
    for key, node in graph.items():
        last = max(node.needs, key=ends.__getitem__, default="")
        ends[key] = seconds.get(key, 0.0) + ends.get(last, 0.0)
        before[key] = last
    key = max(ends, key=ends.__getitem__, default="")
    chain = []
    while key:
        chain.append(key)
        key = before[key]
    return tuple(reversed(chain))
