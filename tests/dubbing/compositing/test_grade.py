"""A head takes on contrast, saturation and black of a film that is graded otherwise."""

import cv2
import numpy as np
import pytest

from dubbing.compositing.grade import (
    CHANGES_FROM,
    LUMA,
    NEUTRAL,
    graded,
    graded_colours,
    grades,
    measured,
    noticed,
)

H, W = 80, 88
FACE = np.hypot(*(np.mgrid[0:H, 0:W] - 40.0)) < 36
LAMP = np.linspace(0.6, 1.2, W)[:, None] * (1.0, 0.95, 0.8)


def head() -> np.ndarray:
    """A face (H, W, 3), 0..255: skin that varies slowly, brows, lips and teeth, a dark mouth."""
    rows, across = np.mgrid[0:H, 0:W] / W
    picture = (165 + 30 * np.cos(4 * across) * np.sin(3 * rows))[..., None] + (35.0, 0, -20)
    picture[..., 1:] -= 18 * (np.sin(25 * rows) * np.sin(21 * across))[..., None]  # redder cheeks
    picture[12:15, 20:36] = picture[12:15, 52:68] = 60, 45, 40
    picture[50:60, 30:58] = 180, 90, 95
    picture[54:57, 34:54] = 30, 15, 15
    picture[53:54, 36:52] = 220, 215, 200
    return np.asarray(picture + np.random.default_rng(0).normal(0, 2, picture.shape))


def film(contrast: float, saturation: float, black: float) -> np.ndarray:
    own = head()
    grey = (own @ LUMA)[..., None]
    return np.asarray(LAMP * (contrast * (saturation * own + (1 - saturation) * grey) + black))


@pytest.mark.parametrize(
    "grade", [(0.7, 1, 60), (1, 0.4, 0), (1.3, 1, -30), (0.6, 0.5, 80)], ids=str
)
def test_a_grade_is_measured_whatever_the_light(grade: tuple[float, float, float]) -> None:
    picture, own = film(*grade), head()
    found = measured(picture, own, FACE)
    assert found[3] > CHANGES_FROM

    def off(made: np.ndarray) -> float:
        """How far the mouth is from the film's, in the light of the face around."""
        light = [cv2.GaussianBlur(x * FACE[..., None], (0, 0), 20) for x in (picture, made)]
        apart = picture - made * light[0] / np.maximum(light[1], 1)
        return float(np.abs(apart[50:60, 30:58]).mean())

    right = off(picture / LAMP)
    assert off(graded_colours(own, found[:3])) - right < 0.3 * (off(own) - right)


def test_a_film_of_the_same_grade_changes_nothing() -> None:
    """Nor does one with something over a part of the face, or of which too little is seen."""
    same = film(1, 1, 0)
    hand, picture_in_picture = same.copy(), same.copy()
    hand[20:45, 8:30] = 120, 70, 50
    rows, across = np.mgrid[0:40, 0:36]
    picture_in_picture[36:76, 4:40] = np.where((rows // 8 + across // 8) % 2, 230, 20)[..., None]
    picture_in_picture[36:76, 4:40, 2] *= 0.2
    faces = (same, FACE), (hand, FACE), (picture_in_picture, FACE), (film(0.7, 1, 60), FACE & False)
    for picture, known in faces:
        np.testing.assert_array_equal(noticed(measured(picture, head(), known)), NEUTRAL)


def test_light_from_another_side_is_no_grade() -> None:
    """Nose and cheeks have their shades on the other side, which no contrast explains."""
    shades = np.ones((2, H, W, 1))
    for rows, columns in (((24, 46), (32, 42)), ((40, 62), (8, 18)), ((20, 34), (10, 20))):
        shades[0, slice(*rows), slice(*columns)] = 0.6
    shades[0, 62:72, 20:40] = 0.6
    shades[1] = shades[0, :, ::-1]
    own, picture = (head() * cv2.GaussianBlur(s, (0, 0), 2)[..., None] for s in shades)
    np.testing.assert_array_equal(noticed(measured(LAMP * picture, own, FACE)), NEUTRAL)
    found = measured(LAMP * (0.6 * picture + 70), own, FACE)
    assert found[:2].sum() == pytest.approx(0.6 * 150 / (0.6 * 150 + 70), abs=0.06)


def test_grades_go_from_frame_to_frame_steadily() -> None:
    faded = np.array([0.7, 0, 60, 30.0])
    odd = np.array([0.2, 0, 150, 90.0])
    found = grades(np.array([2, 5, 8, 11]), [faded, odd, faded, faded], np.arange(2, 14))
    unknown = grades(np.arange(3), [np.full(4, np.nan)] * 3, np.arange(3))
    np.testing.assert_array_equal(unknown, np.tile(NEUTRAL, (3, 1)))
    np.testing.assert_allclose(found, np.tile(faded[:3], (12, 1)))
    np.testing.assert_array_equal(grades(np.arange(0), [], np.arange(3)), np.tile(NEUTRAL, (3, 1)))


def test_a_head_is_graded_where_it_is_and_as_far_as_it_is_opaque() -> None:
    opacity = np.array([[0, 128, 255]])
    colour = np.array([10.0, 20, 40])
    premultiplied = (opacity[..., None] / 255 * colour).round()
    seen = np.concatenate([premultiplied, opacity[..., None]], 2).astype(np.uint8)
    out = graded(seen, np.array([0.5, 0, 60]))
    np.testing.assert_array_equal(out[..., 3], opacity)
    np.testing.assert_array_equal(out[0, 0], 0)
    np.testing.assert_allclose(out[0, 2, :3], 0.5 * colour + 60, atol=1)
    np.testing.assert_allclose(out[0, 1, :3], (0.5 * colour + 60) * 128 / 255, atol=1)
    assert graded(seen, NEUTRAL) is seen
