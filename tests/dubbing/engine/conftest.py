"""The three executors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster

from dubbing.engine.running.cluster import Cluster
from dubbing.engine.running.executors import Executor, InLine
from dubbing.engine.running.processes import Processes
from tests.dubbing.engine.small_graph import program

WORKERS = 2
Make = Callable[[Path], Executor]


@pytest.fixture(scope="session")
def scheduler() -> Iterator[Any]:
    """A Dask cluster of two workers on this machine, each a process of its own."""
    with LocalCluster(WORKERS, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster


@pytest.fixture(params=["in line", "processes", "dask"])
def kind(request: pytest.FixtureRequest) -> str:
    """Which executor."""
    return str(request.param)


@pytest.fixture
def executor(kind: str, request: pytest.FixtureRequest) -> Iterator[Make]:
    """Makes the executor of a manifest."""
    with ExitStack() as stack:

        def make(manifest: Path) -> Executor:
            made: Executor = InLine()
            if kind == "processes":
                made = Processes(program(manifest), WORKERS)
            elif kind == "dask":
                address = request.getfixturevalue("scheduler").scheduler_address
                made = Cluster(program(manifest), address)
            return stack.enter_context(closing(made))

        yield make
