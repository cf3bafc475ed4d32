"""Replaced pixels get the noise and the focus of the film."""

import cv2
import numpy as np
import pytest

from dubbing.compositing.film_look import (
    detail,
    in_focus,
    line,
    luma,
    with_noise,
)
from dubbing.preparation.crops.film_noise import measured

S = 160
QUIET, STILL = np.zeros(5), np.zeros(2)
EVERYWHERE = np.full((S, S), 255, np.uint8)


def skin(sigma: float = 0.8) -> np.ndarray:
    """A picture (S, S, 3) with fine detail."""
    drawn = np.random.default_rng(0).standard_normal((S, S, 3))
    fine = cv2.GaussianBlur(drawn, (0, 0), sigma)
    return np.clip(120 + 12 * fine / fine.std(), 0, 255).astype(np.uint8)


def head_of(image: np.ndarray) -> np.ndarray:
    return np.concatenate([image, EVERYWHERE[..., None]], 2)


@pytest.mark.parametrize("noise", [(6, 6, 6, 0.0, 0.0), (3, 4, 7, 0.9, 0.0), (5, 5, 5, 0.2, 0.5)])
def test_the_noise_is_that_which_was_measured(noise: tuple[float, ...]) -> None:
    grey = np.full((S, S, 3), 120, np.uint8)
    frames = [with_noise(grey, EVERYWHERE, np.array(noise), k) for k in (1, 2)]
    found = measured(*frames)
    assert found is not None
    np.testing.assert_allclose(found[:3], noise[:3], rtol=0.12)
    np.testing.assert_allclose(found[3:], noise[3:], atol=0.13)


def test_a_frame_has_the_same_noise_each_time_and_only_where_it_is_replaced() -> None:
    grey, noise = np.full((S, S, 3), 120, np.uint8), np.array([5.0, 5, 5, 0.5, 0.3])
    replaced = np.zeros((S, S), np.uint8)
    replaced[40:120, 40:120] = 255
    first, again, other = (with_noise(grey, replaced, noise, k) for k in (7, 7, 8))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    np.testing.assert_array_equal(first[replaced == 0], grey[replaced == 0])
    assert with_noise(grey, replaced, QUIET, 7) is grey


@pytest.mark.parametrize("sigma", [0.8, 1.5, 2.5])
def test_a_film_out_of_focus_has_a_head_out_of_focus(sigma: float) -> None:
    sharp = skin()
    film = cv2.GaussianBlur(sharp, (0, 0), sigma)
    made = in_focus(film, head_of(sharp), EVERYWHERE > 0, QUIET, STILL)
    here = np.ones((S, S), bool)
    wanted, got, before = (detail(luma(x), here) for x in (film, made[..., :3], sharp))
    assert before > 1.3 * wanted
    assert got == pytest.approx(wanted, rel=0.15)


def test_a_head_as_sharp_as_the_film_stays_as_it_is() -> None:
    head = head_of(skin())
    assert in_focus(skin(), head, EVERYWHERE > 0, QUIET, STILL) is head
    blurred = cv2.GaussianBlur(skin(), (0, 0), 2)
    nowhere = np.zeros((S, S), bool)
    assert in_focus(blurred, head, nowhere, QUIET, STILL) is head


def test_noise_is_not_taken_for_detail() -> None:
    soft, here = cv2.GaussianBlur(skin(), (0, 0), 1), np.ones((S, S), bool)
    noise = np.array([3.0, 3, 3, 0.0, 0.0])
    film = with_noise(soft, EVERYWHERE, noise, 3)
    made = in_focus(film, head_of(skin()), EVERYWHERE > 0, noise, STILL)
    assert detail(luma(made[..., :3]), here) == pytest.approx(detail(luma(soft), here), rel=0.4)


def test_noise_may_hide_the_focus() -> None:
    noise, head = np.array([9.0, 9, 9, 0.0, 0.0]), head_of(skin())
    film = with_noise(cv2.GaussianBlur(skin(), (0, 0), 2), EVERYWHERE, noise, 3)
    assert in_focus(film, head, EVERYWHERE > 0, noise, STILL) is head


def test_a_head_that_moves_is_blurred_along_its_way() -> None:
    sharp, motion = skin(), np.array([8.0, 0.0])
    film = cv2.filter2D(sharp, -1, line(0.6 * motion))
    made = in_focus(film, head_of(sharp), EVERYWHERE > 0, QUIET, motion)[..., :3]
    inside = np.s_[20:-20, 20:-20]
    away, before = (np.abs(x[inside].astype(int) - film[inside]).mean() for x in (made, sharp))
    assert away < 0.25 * before


def test_the_kernel_of_a_motion() -> None:
    for motion in ([0.0, 0.0], [3.0, 0.0], [-2.0, 5.5]):
        kernel = line(np.array(motion))
        assert kernel.sum() == pytest.approx(1)
        x = np.indices(kernel.shape)[1] - len(kernel) // 2
        assert (kernel * x).sum() == pytest.approx(0, abs=1e-5)
        assert np.sqrt((kernel * x**2).sum()) == pytest.approx(abs(motion[0]) / 12**0.5, abs=0.5)
