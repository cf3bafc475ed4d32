"""A run is simulated as it goes."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubbing.engine.graph.graph import nodes
from dubbing.engine.planning.schedule import longest_chain, simulate
from tests.dubbing.engine.small_graph import jobs_of, write_manifest

# Of a person: prepare 3 | check_source 1 -> finetune 10; of a dub: listen 1 -> render 4.
SECONDS = {"prepare": 3.0, "check_source": 1.0, "finetune": 10.0, "listen": 1.0, "render": 4.0}


@pytest.mark.parametrize(
    ("workers", "expected"),
    [
        (1, 2 * 14 + 3 * 5),
        # prepare 3 and 3, check_source 1 and 1: both fine-tunes begin at 4 and end at 14. Then
        # three times listen, side by side, until 15.5: at 15, and at 16 with the first render at
        # 15 to 19; the second 16 to 20; the third 19 to 23.
        (2, 23.0),
        (100, 3 + 10 + 4),
    ],
)
def test_so_long_on_so_many_workers(tmp_path: Path, workers: int, expected: float) -> None:
    dubs = {"ann_it": "ann", "ann_de": "ann", "bob_it": "bob"}
    graph = nodes(jobs_of(write_manifest(tmp_path, ["ann", "bob"], dubs)))
    seconds = {key: SECONDS[node.stage.kind] for key, node in graph.items()}
    assert simulate(graph, seconds, workers) == expected
    assert longest_chain(graph, seconds) == 3 + 10 + 4
