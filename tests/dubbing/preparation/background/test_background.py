"""The restored background: known pixels stay, the head's own never come back."""

import numpy as np

from dubbing.preparation.background.background import PLATE_FRAMES, plate_frames
from dubbing.preparation.background.filling import pull_push, restore
from dubbing.preparation.background.pixels import chosen, extent, rounded
from dubbing.preparation.background.wall import (
    all_of,
    background_pixels,
    halved,
    plate,
    slow_difference,
)

SIZE = 96
HEAD = np.array([250, 0, 250], np.uint8)  # a colour that nothing else has
SKIN, WALL = np.array([200, 150, 120], np.uint8), np.array([60, 90, 130], np.uint8)


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, person mask and inpaint mask of a head on a neck before a wall."""
    image = np.tile(WALL, (SIZE, SIZE, 1))
    image[60:, 36:60] = SKIN
    image[12:60, 30:66] = HEAD
    person = np.zeros((SIZE, SIZE), np.uint8)
    person[60:, 36:60] = person[12:60, 30:66] = 255
    region = np.zeros((SIZE, SIZE), bool)
    region[8:62, 26:70] = True
    return image, person, region


def test_nothing_of_the_head_is_in_the_background_and_the_rest_is_untouched() -> None:
    image, person, region = scene()
    behind = np.tile(WALL.astype(np.float32), (SIZE, SIZE, 1))
    wall = behind + slow_difference(image, behind, background_pixels(person), SIZE)
    out = restore(image, region, person.astype(np.float32) / 255, wall)
    assert np.array_equal(out[~region], image[~region])
    # Red stays below the skin's, and green above the wall's shade: no trace of 250, 0, 250.
    assert out[region][:, 0].max() <= 205
    assert out[region][:, 1].min() >= 80
    assert np.abs(out[61, 48].astype(int) - SKIN).max() < 25  # the neck goes on upwards
    assert np.abs(out[20, 48].astype(int) - WALL).max() < 25  # not into the middle of the face


def test_what_lies_beside_a_steep_jaw_goes_on_into_its_place() -> None:
    # A column of skin stands beside the inpaint mask.
    image = np.tile(WALL, (512, 512, 1))
    image[100:300, 300:340] = SKIN
    person = np.zeros((512, 512), np.float32)
    person[100:300, 300:340] = 1
    region = np.zeros((512, 512), bool)
    region[100:300, 200:300] = True
    image[region] = HEAD
    wall = np.tile(WALL.astype(np.float32), (512, 512, 1))
    out = restore(image, region, person, wall)
    assert np.array_equal(out[~region], image[~region])
    np.testing.assert_allclose(out[150:250, 298:300], np.tile(SKIN, (100, 2, 1)), atol=20)
    # Where there is wall beside the inpaint mask the wall goes on.
    np.testing.assert_allclose(out[150:250, 200:205], np.tile(WALL, (100, 5, 1)), atol=8)


def test_stripes_beside_a_hole_do_not_go_on_into_it() -> None:
    image = np.tile(SKIN, (512, 512, 1))
    image[::2] = SKIN // 2
    person = np.ones((512, 512), np.float32)
    region = np.zeros((512, 512), bool)
    region[100:300, 200:300] = True
    out = restore(image, region, person, np.zeros((512, 512, 3), np.float32))
    assert np.abs(np.diff(out[150:250, 292, 0].astype(int))).max() < 0.2 * SKIN[0] / 2


def test_plate_is_the_median_of_what_is_known_and_smooth_elsewhere() -> None:
    rng = np.random.default_rng(0)
    truth = np.stack(np.meshgrid(np.arange(40.0), np.arange(30.0)), -1).sum(-1) + 60
    images = np.repeat(truth[None, ..., None], 9, 0).repeat(3, -1)
    images = (images + rng.integers(-3, 4, images.shape)).astype(np.uint8)
    known = np.ones((9, 30, 40), bool)
    known[:, 10:20, 15:25] = False
    images[:, 10:20, 15:25] = 255
    known[:4, :, 5] = False
    images[:4, :, 5] = 0
    out = plate(images, known)
    seen = known.any(0)
    assert np.abs(out - truth[..., None])[seen].max() <= 3
    assert np.abs(out - truth[..., None])[~seen].max() < 15


def test_pull_push_keeps_what_is_known_and_fills_the_rest_within_its_range() -> None:
    rng = np.random.default_rng(0)
    image = rng.uniform(50, 100, (33, 47, 3)).astype(np.float32)
    known = rng.random((33, 47)) < 0.3
    out = pull_push(image, known.astype(np.float32))
    np.testing.assert_allclose(out[known], image[known], rtol=1e-5)
    assert out.min() >= 49
    assert out.max() <= 101


def test_light_that_changes_slowly_is_carried_behind_a_person() -> None:
    behind = np.full((SIZE, SIZE, 3), 90, np.float32)
    image = np.full((SIZE, SIZE, 3), 110, np.uint8)
    known = np.ones((SIZE, SIZE), bool)
    known[30:60, 30:60] = False
    image[~known] = 250
    whole = slow_difference(image, behind, known, SIZE)
    half = slow_difference(halved(image), halved(behind), all_of(known), SIZE)
    for light in (whole, half):
        np.testing.assert_allclose(light, 110 - 90, atol=1e-3)


def test_pixels_are_rounded_and_chosen() -> None:
    levels = np.array([[[-3.0, 0.4, 0.6], [254.6, 300, 100.2]]], np.float32)
    assert rounded(levels).tolist() == [[[0, 0, 1], [255, 255, 100]]]
    one, other = np.full((1, 2, 3), 7, np.uint8), np.full((1, 2, 3), 9, np.uint8)
    where = np.array([[True, False]])
    assert chosen(where, one, other).tolist() == [[[7] * 3, [9] * 3]]
    assert other.min() == 9


def test_a_box_holds_a_region_and_its_surroundings_within_the_picture() -> None:
    region = np.zeros((20, 30), bool)
    region[3:8, 10] = region[5, 9:14] = True
    assert extent(region) == (slice(3, 8), slice(9, 14))
    assert extent(region, 5) == (slice(0, 13), slice(4, 19))
    assert extent(region, 40) == (slice(0, 20), slice(0, 30))


def test_plates_are_of_frames_spread_over_each_shot() -> None:
    segment, lit = np.repeat([0, 1], [3, 391]), np.ones(394, bool)
    short, long = plate_frames(segment, lit)
    assert short.tolist() == [0, 1, 2]
    assert np.array_equal(long, 3 + 10 * np.arange(PLATE_FRAMES))
    lit[:], lit[[1, 5, 6]] = False, True
    short, long = plate_frames(segment, lit)
    assert short.tolist() == [1]
    assert long.tolist() == [5, 6]
    assert plate_frames(segment, lit & False)[0].tolist() == [0, 1, 2]  # all are dark: no choice
