"""Skin of a head that is smoother than the film's, on made pictures."""

import cv2
import numpy as np
import pytest

from dubbing.compositing.skin_detail import lip_share, with_detail_of
from dubbing.face.mouth.lip_region import lip_region
from tests import fakes

S = 320
EVERYWHERE = np.ones((S, S), bool)
QUIET = np.zeros(5)
BLUR = 1.5  # px, of a head blended from several frames
CHEEK = np.s_[12:48, 12:308]  # the fake face is mostly mouth


def skin(seed: int = 0) -> np.ndarray:
    """Skin (S, S, 3) float32: pores, spots and broad shading."""
    rng = np.random.default_rng(seed)
    tone = np.full((S, S), 140.0)
    for sigma, height in ((1, 5), (4, 10), (12, 15)):
        spots = cv2.GaussianBlur(rng.normal(0, 1, (S, S)), (0, 0), sigma)
        tone += height * spots / spots.std()
    return np.repeat(tone[..., None], 3, axis=2).astype(np.float32)


def as_head(image: np.ndarray) -> np.ndarray:
    """An opaque head of these colours, (S, S, 4) uint8."""
    return np.dstack([image, np.full((S, S), 255.0)]).round().clip(0, 255).astype(np.uint8)


def moved(image: np.ndarray, down: float) -> np.ndarray:
    shift = np.array([[1, 0, 0], [0, 1, down]], np.float32)
    return np.asarray(cv2.warpAffine(image, shift, (S, S), borderMode=cv2.BORDER_REFLECT))


def likeness(one: np.ndarray, other: np.ndarray) -> float:
    """Correlation of the fine detail of two pictures on the cheek."""
    a, b = (
        (x - cv2.GaussianBlur(x, (0, 0), 2.0))[CHEEK].ravel() for x in (one[..., 0], other[..., 0])
    )
    return float(np.corrcoef(a, b)[0, 1])


def dubbed(film: np.ndarray, head: np.ndarray, **changed: np.ndarray) -> np.ndarray:
    seen = {"shown": EVERYWHERE, "replaced": EVERYWHERE, "noise": QUIET} | changed
    image = film.round().clip(0, 255).astype(np.uint8)
    return with_detail_of(image, head=head, landmarks=fakes.face(S), **seen)


@pytest.mark.parametrize("down", [0, 4, 9])
def test_the_films_detail_goes_with_the_jaw(down: int) -> None:
    film = skin()
    truth = moved(film, down)
    head = as_head(cv2.GaussianBlur(truth, (0, 0), BLUR))
    found = dubbed(film, head)
    assert likeness(found.astype(np.float32), truth) > 0.95
    assert likeness(head.astype(np.float32), truth) < 0.85
    np.testing.assert_array_equal(found[..., 3], head[..., 3])


def test_lips_say_other_words_and_stay() -> None:
    film = skin()
    head = as_head(cv2.GaussianBlur(film, (0, 0), BLUR))
    lips = lip_share(lip_region(fakes.face(S), S), S / 512) > 0.999
    assert lips.sum() > 500
    np.testing.assert_array_equal(dubbed(film, head)[lips], head[lips])


def test_what_lies_over_the_face_is_no_skin() -> None:
    film = skin()
    head = as_head(cv2.GaussianBlur(film, (0, 0), BLUR))
    shown = EVERYWHERE.copy()
    shown[:, S // 2 :] = False
    found = dubbed(film, head, shown=shown)
    np.testing.assert_array_equal(found[:, S // 2 + 8 :], head[:, S // 2 + 8 :])
    assert (found[:, : S // 2 - 8] != head[:, : S // 2 - 8]).any()


def test_other_skin_gives_nothing() -> None:
    head = as_head(cv2.GaussianBlur(skin(seed=1), (0, 0), BLUR))
    found = dubbed(0.3 * skin(), head)
    np.testing.assert_array_equal(found, head)


def test_noise_is_no_detail() -> None:
    """Replaced pixels get noise of their own."""
    film = skin()
    noise = np.array([6.0, 6.0, 6.0, 1.0, 0.0])
    head = as_head(cv2.GaussianBlur(film, (0, 0), BLUR))
    np.testing.assert_array_equal(dubbed(film, head, noise=noise), head)


def test_no_head_and_nothing_replaced() -> None:
    empty = np.zeros((S, S, 4), np.uint8)
    np.testing.assert_array_equal(dubbed(skin(), empty), empty)
    head = as_head(skin())
    np.testing.assert_array_equal(dubbed(skin(), head, replaced=~EVERYWHERE), head)
