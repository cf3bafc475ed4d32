"""Figures of the lips, beside slow loops and visible arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dubbing.workshop.lab.metrics import lips

NAN = float("nan")
RATE = 25.0


def closed(*frames: int, count: int = 10) -> np.ndarray:
    """A gap that is closed in some frames and open in all others."""
    gap = np.full(count, 0.1)
    gap[list(frames)] = 0.01
    return gap


def slow_correlation(found: np.ndarray, truth: np.ndarray) -> float:
    """Pearson's correlation, a frame at a time."""
    pairs = [p for p in zip(found, truth, strict=True) if not any(map(math.isnan, p))]
    mean_a = sum(a for a, _ in pairs) / len(pairs)
    mean_b = sum(b for _, b in pairs) / len(pairs)
    both = sum((a - mean_a) * (b - mean_b) for a, b in pairs)
    square_a = sum((a - mean_a) ** 2 for a, _ in pairs)
    square_b = sum((b - mean_b) ** 2 for _, b in pairs)
    return both / math.sqrt(square_a * square_b)


def slow_f1(found: np.ndarray, truth: np.ndarray, near: int) -> float:
    """F1, a frame at a time; hits of both sides are counted by themselves."""

    def is_closed(series: np.ndarray, other: np.ndarray, t: int) -> bool:
        measured = 0 <= t < len(series) and not math.isnan(series[t] + other[t])
        return bool(measured and series[t] < lips.CLOSED)

    hits, counts = [], []
    for mine, other in ((found, truth), (truth, found)):
        frames = [t for t in range(len(mine)) if is_closed(mine, other, t)]
        counts.append(len(frames))
        hits.append(
            sum(any(is_closed(other, mine, t + d) for d in range(-near, near + 1)) for t in frames)
        )
    precision, recall = hits[0] / counts[0], hits[1] / counts[1]
    return 2 * precision * recall / (precision + recall)


def test_correlation_is_that_of_a_loop_and_passes_over_what_is_not_known() -> None:
    random = np.random.default_rng(0)
    found, truth = random.normal(size=(2, 40))
    truth += found
    found[[3, 7]], truth[[7, 20]] = NAN, NAN
    assert lips.correlation(found, truth) == pytest.approx(slow_correlation(found, truth))
    assert lips.correlation(2 * truth + 1, truth) == pytest.approx(1)
    assert lips.correlation(-truth, truth) == pytest.approx(-1)


def test_a_mouth_that_stands_still_correlates_with_nothing() -> None:
    moving = np.arange(5.0)
    assert math.isnan(lips.correlation(np.ones(5), moving))
    assert math.isnan(lips.correlation(np.array([1.0, 2, NAN, NAN, NAN]), moving))


def test_closures_by_hand() -> None:
    # Two of three found are right, two of four are found: 2 (2/3)(2/4) / (2/3 + 2/4) = 4/7.
    found, truth = closed(1, 2, 8), closed(1, 2, 4, 5)
    assert lips.closure_f1(found, truth) == pytest.approx(4 / 7)
    # A frame late everywhere: nothing exact, everything within one frame.
    assert lips.closure_f1(closed(3, 7), closed(2, 6)) == 0
    assert lips.closure_f1(closed(3, 7), closed(2, 6), tolerance=1) == 1
    # One closed frame among three closed ones: each has a neighbour within one frame.
    assert lips.closure_f1(closed(5), closed(4, 5, 6)) == pytest.approx(2 / 4)
    assert lips.closure_f1(closed(5), closed(4, 5, 6), tolerance=1) == 1


def test_no_closure_is_no_figure_and_a_missed_one_is_nought() -> None:
    assert math.isnan(lips.closure_f1(closed(), closed()))
    assert lips.closure_f1(closed(), closed(3)) == 0
    assert lips.closure_f1(closed(3), closed()) == 0
    # At .02 itself the lips are apart.
    assert math.isnan(lips.closure_f1(np.full(4, lips.CLOSED), np.full(4, 0.1)))


@pytest.mark.parametrize("near", [0, 1, 2])
def test_closures_are_those_of_a_loop(near: int) -> None:
    random = np.random.default_rng(near)
    found, truth = random.uniform(0, 0.08, (2, 200))
    found[random.random(200) < 0.1] = NAN
    truth[random.random(200) < 0.1] = NAN
    assert lips.closure_f1(found, truth, near) == pytest.approx(slow_f1(found, truth, near))


def test_closures_within_a_frame_do_not_reach_across_frames_that_were_not_measured() -> None:
    found, truth = closed(3), closed(5)
    found[4] = truth[4] = NAN
    assert lips.closure_f1(found, truth, tolerance=1) == 0


def test_ratios_by_hand() -> None:
    truth = np.array([0.0, 2.0, 4.0, NAN])
    found = np.array([1.0, 2.0, 3.0, 100.0])
    assert lips.spread_ratio(found, truth) == pytest.approx(0.5)
    assert lips.energy_ratio(found, truth) == pytest.approx(6 / 6)
    assert math.isnan(lips.spread_ratio(found, np.ones(4)))
    assert math.isnan(lips.energy_ratio(found, np.zeros(4)))


def test_distances_by_hand() -> None:
    truth = np.zeros((2, 2, 2))
    found = np.array([[[3.0, 4.0], [0.0, 0.0]], [[NAN, 0.0], [0.0, 0.0]]])
    assert lips.distances(found, truth)[0] == 2.5  # of 5 and 0
    squares = lips.squared_distances(found, truth)
    assert squares[0] == 12.5  # of 25 and 0
    assert lips.rms(squares) == pytest.approx(math.sqrt(12.5))
    assert math.isnan(lips.rms(squares[1:]))


def test_distances_are_those_of_a_loop() -> None:
    found, truth = np.random.default_rng(1).normal(size=(2, 5, 40, 2))
    each = [
        [math.dist(a, b) for a, b in zip(*frame, strict=True)]
        for frame in np.stack([found, truth], 1)
    ]
    assert lips.distances(found, truth) == pytest.approx([sum(d) / 40 for d in each])
    squares = [sum(x * x for x in d) / 40 for d in each]
    assert lips.squared_distances(found, truth) == pytest.approx(squares)


@pytest.mark.parametrize("frames", [-3.4, -1.0, 0.0, 0.25, 2.5])
def test_a_lag_is_found_to_a_part_of_a_frame(frames: float) -> None:
    time = np.arange(200.0)

    def opening(t: np.ndarray) -> np.ndarray:
        return np.sin(t * 0.5) + 0.7 * np.sin(t * 0.23 + 1)

    late = lips.lag_ms(opening(time - frames), opening(time), RATE)
    assert late == pytest.approx(1000 * frames / RATE, abs=2)


def test_there_is_no_lag_where_nothing_fits_or_it_lies_beyond_the_search() -> None:
    random = np.random.default_rng(2)
    moving = random.normal(size=100)
    assert math.isnan(lips.lag_ms(np.ones(100), moving, RATE))
    late = np.roll(moving, 11)
    assert lips.lag_ms(late, moving, RATE, max_lag=0.6) == pytest.approx(440, abs=10)
    assert math.isnan(lips.lag_ms(moving[:3], moving[:3], RATE))  # too few frames to shift
    assert math.isnan(lips.lag_ms(moving[:0], moving[:0], RATE))
    pulse = np.exp(-(((np.arange(100.0) - 50) / 8) ** 2))
    assert math.isnan(lips.lag_ms(np.roll(pulse, 30), pulse, RATE, max_lag=0.4))
