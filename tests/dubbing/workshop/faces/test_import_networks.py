"""The importer writes the files that ship; runs where the source is installed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open

from dubbing.face.weight_paths import FACE_WEIGHTS, HAND_WEIGHTS, PERSON_WEIGHTS
from dubbing.workshop.faces.import_networks import NETWORKS, import_network, read_source
from dubbing.workshop.faces.parallel import merged, without_repetitions
from tests import needs

SHIPPED = FACE_WEIGHTS | HAND_WEIGHTS | PERSON_WEIGHTS


@pytest.mark.parametrize("name", NETWORKS)
def test_the_importer_writes_what_ships(name: str, tmp_path: Path) -> None:
    folder = needs.mediapipe()
    path = tmp_path / f"{name}.safetensors"
    import_network(read_source(folder, NETWORKS[name]), NETWORKS[name], path)
    with safe_open(path, "np") as made, safe_open(SHIPPED[name], "np") as shipped:
        assert sorted(made.keys()) == sorted(shipped.keys())
        for key in made.keys():  # noqa: SIM118
            np.testing.assert_array_equal(made.get_tensor(key), shipped.get_tensor(key))
        headers = made.metadata(), shipped.metadata()
    ours, theirs = (json.loads(header.pop("expected")) for header in headers)
    np.testing.assert_allclose(ours, theirs, rtol=1e-3)
    assert headers[0] == headers[1]


def test_what_is_computed_twice_is_computed_once() -> None:
    weights = {"2.0": np.ones(3), "3.0": np.ones(3), "4.0": np.zeros(3)}
    steps = [
        {"op": "prelu", "in": [1], "out": 2, "weights": ["2.0"]},
        {"op": "prelu", "in": [1], "out": 3, "weights": ["3.0"]},
        {"op": "prelu", "in": [1], "out": 4, "weights": ["4.0"]},
        {"op": "add", "in": [3, 4], "out": 5},
    ]
    kept = without_repetitions(steps, weights)
    assert [step["out"] for step in kept] == [2, 4, 5]
    assert kept[-1]["in"] == [2, 4]
    assert set(weights) == {"2.0", "4.0"}


def test_branches_lie_side_by_side() -> None:
    weights = {f"{k}.0": np.full(2, k) for k in (5, 6, 7)}
    steps = [
        {"op": "box", "in": [1], "out": 2, "ends": [[0, 1]], "points": [[0, 1]]},
        {"op": "box", "in": [1], "out": 3, "ends": [[2, 3]], "points": [[2, 3]]},
        {"op": "prelu", "in": [2], "out": 5, "weights": ["5.0"]},
        {"op": "prelu", "in": [3], "out": 6, "weights": ["6.0"]},
        {"op": "prelu", "in": [3], "out": 7, "weights": ["7.0"]},
        {"op": "relu", "in": [7], "out": 8},
    ]
    made = merged(steps, [8], weights)
    assert [step["op"] for step in made] == ["box", "take", "prelu", "take", "relu"]
    assert made[0]["points"] == [[0, 1], [2, 3]]
    assert made[1]["places"] == [0, 1, 1]
    assert made[3]["places"] == [2]
    assert {k: v.tolist() for k, v in weights.items()} == {"5.0": [5, 5, 6, 6, 7, 7]}
