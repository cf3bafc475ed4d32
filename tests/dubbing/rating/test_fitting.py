"""Fitted weights are those that answers were drawn with; few answers leave today's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import expit

from dubbing.rating import fitting
from dubbing.rating.answers import Answer
from dubbing.sync.closeness import WEIGHTS
from tests.dubbing.rating.versions import side

TODAY = np.array([*WEIGHTS.values()])
PLANTED = np.array([0.05, 0.05, 0.3, 0.1, 0.1, 0.1, 0.0, 0.3, 0.0])


def drawn(count: int, weights: np.ndarray, sharp: float = 15.0) -> tuple[np.ndarray, np.ndarray]:
    """Differences and the answers of people with such weights."""
    rng = np.random.default_rng(0)
    differing = rng.normal(scale=0.4, size=(count, len(WEIGHTS)))
    first = rng.random(count) < expit(sharp * differing @ weights)
    return differing, first.astype(float)


def test_planted_weights_are_found() -> None:
    assert PLANTED.sum() == pytest.approx(1)
    found = fitting.fitted(*drawn(4000, PLANTED))
    assert found.sum() == pytest.approx(1)
    assert (found >= 0).all()
    np.testing.assert_allclose(found, PLANTED, atol=0.03)


def test_few_answers_leave_todays_weights() -> None:
    distance = [
        np.abs(fitting.fitted(*drawn(count, PLANTED)) - TODAY).sum() for count in (4, 60, 4000)
    ]
    assert distance[0] < 0.1 < distance[1] < distance[2]


def test_a_part_that_never_differs_keeps_its_share_beside_others() -> None:
    differing, first = drawn(4000, TODAY)
    differing[:, 0] = 0
    found = fitting.fitted(differing, first)
    assert found[0] == pytest.approx(TODAY[0], abs=0.05)


def test_weights_are_measured_on_dubs_that_they_were_not_fitted_to() -> None:
    differing, first = drawn(400, PLANTED, sharp=100)
    dubs = [f"d{k % 20}" for k in range(400)]
    left_out = fitting.left_out(differing, first, dubs)
    assert left_out.of == 400
    assert left_out.counted > 340
    assert fitting.left_out(differing, first, ["one"] * 400).of == 0


def test_a_dub_that_contradicts_the_others_is_not_foretold() -> None:
    differing = np.zeros((110, len(WEIGHTS)))
    differing[:, 1:3] = 1, -1
    first = np.repeat([1.0, 0.0], [50, 60])
    assert fitting.left_out(differing, first, ["a"] * 50 + ["b"] * 60) == (0, 110)


def test_differences_are_of_first_over_second() -> None:
    def answer(one: dict[str, float], other: dict[str, float]) -> Answer:
        pair: Any = {"id": "p", "dub": "d", "first": side(0, one), "second": side(1, other)}
        return Answer("ann", pair, 1.0)

    rows, first, dubs = fitting.differences(
        [
            answer({"timing": 0.8, "silence": 0.5}, {"timing": 0.4}),
            answer({"timing": 0.0}, {"timing": 0.1}),
            answer({}, {"timing": 0.1}),
        ]
    )
    assert rows[:, 0] == pytest.approx([1.0, -1.0])  # 0 counts as .05
    assert not rows[:, 1:].any()
    assert (first.tolist(), dubs) == ([1.0, 1.0], ["d", "d"])
