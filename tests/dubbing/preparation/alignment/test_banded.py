"""Banded solving against dense matrices."""

import numpy as np
import pytest

from dubbing.preparation.alignment.banded import (
    DOF,
    lower_band,
    second_difference_links,
    smoothness_blocks,
    solve_band,
    solve_bordered,
)

FRAMES = 9


def dense(diagonal: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """The same matrix, block by block."""
    frames = len(diagonal)
    out = np.zeros((frames, DOF, frames, DOF))
    for t in range(frames):
        out[t, :, t] = diagonal[t]
    for blocks, step in ((one, 1), (two, 2)):
        for t in range(frames - step):
            out[t + step, :, t] = blocks[t]
            out[t, :, t + step] = blocks[t].T
    return out.reshape(frames * DOF, frames * DOF)


@pytest.fixture
def blocks() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(FRAMES, DOF, DOF))
    diagonal = root @ root.transpose(0, 2, 1) + 30 * np.eye(DOF)
    return (
        diagonal,
        rng.normal(size=(FRAMES - 1, DOF, DOF)),
        rng.normal(size=(FRAMES - 2, DOF, DOF)),
    )


def test_band_solves_like_dense(blocks: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    right = np.random.default_rng(1).normal(size=FRAMES * DOF)
    np.testing.assert_allclose(
        solve_band(lower_band(*blocks), right), np.linalg.solve(dense(*blocks), right), rtol=1e-9
    )


def test_border_solves_like_dense(blocks: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    rng = np.random.default_rng(3)
    border = rng.normal(size=(FRAMES * DOF, 4))
    corner = 100 * np.eye(4)
    right, low = rng.normal(size=FRAMES * DOF), rng.normal(size=4)
    whole = np.block([[dense(*blocks), border], [border.T, corner]])
    expected = np.linalg.solve(whole, np.concatenate((right, low)))
    x, y = solve_bordered(lower_band(*blocks), border, corner, right, low)
    np.testing.assert_allclose(np.concatenate((x, y)), expected, rtol=1e-8)


def test_smoothness_is_the_sum_of_squared_second_differences() -> None:
    rng = np.random.default_rng(4)
    linked = np.array([False, True, True, False, False, True, True, True, False])
    weight = rng.uniform(1, 5, DOF)
    x = rng.normal(size=(FRAMES, DOF))
    expected = sum(
        (weight * (x[t - 1] - 2 * x[t] + x[t + 1]) ** 2).sum() for t in np.flatnonzero(linked)
    )
    matrix = dense(*smoothness_blocks(linked, weight))
    assert x.ravel() @ matrix @ x.ravel() == pytest.approx(expected)


def test_links_stop_at_cuts_gaps_and_repeats() -> None:
    segment = np.array([0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1])
    usable = np.ones(11, bool)
    usable[7] = False
    repeated = np.zeros(11, bool)
    assert np.flatnonzero(second_difference_links(segment, usable, repeated)).tolist() == [
        1,
        2,
        5,
        9,
    ]
    repeated[1] = True
    assert np.flatnonzero(second_difference_links(segment, usable, repeated)).tolist() == [2, 5, 9]
