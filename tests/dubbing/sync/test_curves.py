"""Distances over offsets: values, sign, pieces, gaps."""

import numpy as np
import pytest

from dubbing.sync.curves import MAX_OFFSET, OFFSETS, CurveSum, distances, estimate

RNG = np.random.default_rng(0)


def rows_of(mouth: np.ndarray, sound: np.ndarray) -> np.ndarray:
    """Distances of two series of equal length, nothing beyond the ends."""
    beyond = np.full((MAX_OFFSET, sound.shape[1]), np.nan)
    return distances(mouth, np.concatenate([beyond, sound, beyond]))


def test_against_a_slow_loop() -> None:
    mouth, sound = RNG.normal(size=(2, 20, 4))
    rows = rows_of(mouth, sound)
    for i in range(20):
        for k, offset in enumerate(OFFSETS):
            j = i - offset
            if 0 <= j < 20:
                expected = np.sqrt(((mouth[i] - sound[j]) ** 2).sum())
                assert rows[i, k] == pytest.approx(expected, rel=1e-5)
            else:
                assert np.isnan(rows[i, k])


@pytest.mark.parametrize("early", [-15, -3, 0, 4, 15])
def test_early_audio_is_positive(early: int) -> None:
    both = RNG.normal(size=(120, 8))
    # At frame j one hears what the mouth shows `early` frames later.
    mouth, sound = both[20:80], both[20 + early : 80 + early]
    found = estimate(np.nanmean(rows_of(mouth, sound), axis=0))
    assert found is not None
    assert found.offset == early
    assert found.distance == pytest.approx(0, abs=1e-6)
    assert found.confidence > 2


def test_pieces_give_the_whole() -> None:
    mouth, sound = RNG.normal(size=(2, 50, 4))
    rows, weights = rows_of(mouth, sound), RNG.uniform(0.2, 1.2, 50)
    whole, parts = CurveSum.empty(), CurveSum.empty()
    whole.add(rows, weights)
    for a, b in ((0, 7), (7, 33), (33, 50)):
        parts.add(rows[a:b], weights[a:b])
    assert np.allclose(whole.curve(), parts.curve())
    assert whole.rows == parts.rows == 50
    k = OFFSETS.index(-2)
    expected = (rows[:48, k] * weights[:48]).sum() / weights[:48].sum()
    assert whole.curve()[k] == pytest.approx(expected)


def test_a_gap_in_the_curve_is_no_estimate() -> None:
    short = rows_of(*RNG.normal(size=(2, 10, 4)))
    total = CurveSum.empty()
    total.add(short, np.ones(10))
    assert np.isnan(total.curve()[0])
    assert estimate(total.curve()) is None
