"""The noise of a film is measured where nothing else changes."""

import cv2
import numpy as np
import pytest

from dubbing.preparation.crops import film_noise
from dubbing.preparation.crops.film_noise import PAIRS, NoiseMeter, measured

S = 160


def even(shift: float = 0.0) -> np.ndarray:
    """A picture of slow slopes, (S, S, 3), that moves by so many px."""
    x = np.arange(S) + shift
    slope = 110 + 25 * np.sin(x / 60)[None] + 20 * np.cos(np.arange(S) / 70)[:, None]
    return np.repeat(slope[..., None], 3, 2)


def noisy(
    image: np.ndarray, seed: int, deviation: float = 4.0, shared: float = 0.0, sigma: float = 0.0
) -> np.ndarray:
    drawn = np.random.default_rng(seed).standard_normal((S, S, 4))
    noise = np.sqrt(shared) * drawn[..., 3:] + np.sqrt(1 - shared) * drawn[..., :3]
    if sigma:
        noise = cv2.GaussianBlur(noise, (0, 0), sigma)
    return np.clip((image + deviation * noise / noise.std()).round(), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("deviation", [1.0, 4.0, 9.0])
@pytest.mark.parametrize("shift", [0.0, 2.5])
def test_its_deviation_whether_the_camera_stands_or_moves(deviation: float, shift: float) -> None:
    found = measured(noisy(even(), 1, deviation), noisy(even(shift), 2, deviation))
    assert found is not None
    np.testing.assert_allclose(found[:3], deviation, rtol=0.12)
    assert found[3] < 0.1
    assert found[4] < 0.1


def test_things_that_move_are_no_noise() -> None:
    before, after = noisy(even(), 1), noisy(even(), 2)
    rng = np.random.default_rng(0)
    before[:90, :70], after[:90, :70] = rng.integers(0, 255, (2, 90, 70, 3))
    found = measured(before, after)
    assert found is not None
    np.testing.assert_allclose(found[:3], 4, rtol=0.15)


@pytest.mark.parametrize("upright", [False, True])
def test_lines_of_a_filmed_screen_are_no_noise(upright: bool) -> None:
    lines = [20 * np.sin(np.arange(S) * np.pi / 1.5 + t)[:, None, None] for t in (0, 1)]
    if upright:
        lines = [line.swapaxes(0, 1) for line in lines]
    found = measured(noisy(even() + lines[0], 1), noisy(even() + lines[1], 2))
    assert found is not None
    np.testing.assert_allclose(found[:3], 4, rtol=0.12)
    assert found[3] < 0.1


def test_what_channels_and_neighbours_share() -> None:
    grey = measured(noisy(even(), 1, shared=1.0), noisy(even(), 2, shared=1.0))
    coarse = measured(noisy(even(), 1, sigma=0.8), noisy(even(), 2, sigma=0.8))
    assert grey is not None
    assert coarse is not None
    assert grey[3] > 0.95
    assert coarse[4] == pytest.approx(np.exp(-1 / (4 * 0.8**2)), abs=0.08)


@pytest.mark.parametrize("channels", [[2], [0, 1]])
def test_channels_that_never_change_have_no_noise(channels: list[int]) -> None:
    before, after = noisy(even(), 1), noisy(even(), 2)
    before[..., channels] = after[..., channels] = 40
    found = measured(before, after)
    assert found is not None
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[channels], 0, atol=1e-6)


def test_a_film_without_noise_has_none() -> None:
    still = even().astype(np.uint8)
    found = measured(still, still)
    assert found is not None
    assert not found.any()


def test_pairs_are_spread_over_a_shot_and_never_across_a_cut(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    segment = np.repeat([0, 1, 2], [1, 6, 400])
    seen: list[tuple[int, int]] = []
    monkeypatch.setattr(film_noise, "measured", lambda a, b: seen.append((a[0, 0], b[0, 0])))
    meter = NoiseMeter(segment, lambda image, _: image[:4, :4])
    for t in range(len(segment)):
        meter.add(t, np.full((4, 4), t))
    assert all(b == a + 1 and segment[a] == segment[b] for a, b in seen)
    assert seen[:5] == [(t, t + 1) for t in range(1, 6)]
    assert len(seen) == 5 + PAIRS
    assert seen[5] == (7, 8)
    assert seen[-1] == (405, 406)


def test_each_shot_has_its_own() -> None:
    segment = np.repeat([0, 1], 12)
    meter = NoiseMeter(segment, lambda image, _: image)
    for t, shot in enumerate(segment):
        meter.add(t, noisy(even(), t, (2.0, 6.0)[shot]))
    noise = meter.noise()
    assert noise.shape == (24, 5)
    np.testing.assert_allclose(noise[0, :3], 2, rtol=0.12)
    np.testing.assert_allclose(noise[-1, :3], 6, rtol=0.12)
