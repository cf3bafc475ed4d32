"""Lips of a film that have another colour than those of the learned head."""

import cv2
import numpy as np
import pytest

from dubbing.compositing.lip_colour import (
    SAME,
    lip_colour,
    measured,
    share_of_lips,
    with_lip_colour,
)

H, W, S = 80, 88, 128
RED = np.array([-0.1, -0.85, -0.5])


def lips(scale: float, middle: tuple[float, float]) -> np.ndarray:
    """Outer and inner edge (40, 2) px of a mouth that is a little open."""
    angle = np.arange(20) * 2 * np.pi / 20
    around = np.stack([np.cos(angle), np.sin(angle)], -1)
    return np.concatenate([around * (9, 5), around * (7, 1.5)]) * scale + middle


SMALL, LARGE = lips(1, (44, 50)), lips(3, (64, 70))


@pytest.mark.parametrize("true", [RED, SAME], ids=["lipstick", "none"])
def test_lipstick_is_measured_in_a_small_picture_of_it(true: np.ndarray) -> None:
    """Most pixels of such lips show skin, too."""
    shown = cv2.GaussianBlur(share_of_lips(SMALL, (H, W)), (0, 0), 0.8)
    noise = np.random.default_rng(0).normal(0, 0.02, (H, W, 3))
    np.testing.assert_allclose(measured(shown[..., None] * true + noise, SMALL), true, atol=0.03)


def test_lips_that_are_hardly_seen_say_nothing() -> None:
    assert np.isnan(measured(np.ones((H, W, 3)), lips(0.2, (44, 50)))).all()


def test_a_colour_counts_that_most_frames_show() -> None:
    unknown = np.full(3, np.nan)
    np.testing.assert_array_equal(lip_colour([RED, unknown, *[RED] * 7, 3 * RED]), RED)
    for found in (
        [RED, RED, unknown],
        [np.array([0.03, -0.03, 0.02])] * 9,  # chance
        [np.array([-0.6, -0.6, -0.55])] * 9,  # light that was not followed
        [RED, -RED] * 5,
    ):
        np.testing.assert_array_equal(lip_colour(found), SAME)


def test_lips_take_it_on_and_skin_and_teeth_do_not() -> None:
    head = np.full((S, S, 4), (200, 150, 140, 255), np.uint8)
    assert with_lip_colour(head, LARGE, SAME) is head
    made = with_lip_colour(head, LARGE, RED)
    share = share_of_lips(LARGE, (S, S))
    inner = cv2.erode(share, np.ones((5, 5))) == 1
    expected = np.array([200, 150, 140]) * np.exp(RED)
    np.testing.assert_allclose(np.median(made[inner][:, :3], 0), expected, atol=2)
    beside = cv2.dilate(share, np.ones((7, 7))) == 0
    assert inner.sum() > 100
    assert beside[70, 64]  # between the lips
    np.testing.assert_array_equal(made[beside], head[beside])


def test_it_stays_premultiplied() -> None:
    head = np.full((S, S, 4), 90, np.uint8)
    made = with_lip_colour(head, LARGE, -RED)
    assert (made[..., :3] <= made[..., 3:]).all()
    assert (made[..., 3] == 90).all()
