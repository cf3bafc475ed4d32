"""The restored background: known pixels stay, the head's own never come back."""

import numpy as np
import pytest

from dubbing.preparation.background.background import PLATE_FRAMES, plate_frames
from dubbing.preparation.background.filling import CONTEXT_PX, pull_push, restore, rim
from dubbing.preparation.background.neck import PROFILE, neck, neck_profile, smooth_profiles
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


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Image, person mask, inpaint mask and landmarks of a head on a neck before a wall."""
    image = np.tile(WALL, (SIZE, SIZE, 1))
    image[60:, 36:60] = SKIN
    image[12:60, 30:66] = HEAD
    person = np.zeros((SIZE, SIZE), np.uint8)
    person[60:, 36:60] = person[12:60, 30:66] = 255
    region = np.zeros((SIZE, SIZE), bool)
    region[8:62, 26:70] = True
    landmarks = np.full((478, 2), 48.0)
    landmarks[234], landmarks[454] = [30, 35], [66, 35]
    return image, person, region, landmarks


def test_nothing_of_the_head_is_in_the_background_and_the_rest_is_untouched() -> None:
    image, person, region, landmarks = scene()
    measured = neck_profile(image, person, region, landmarks)
    profile = smooth_profiles(np.stack([measured] * 3), np.zeros(3, int))[1]
    behind = np.tile(WALL.astype(np.float32), (SIZE, SIZE, 1))
    wall = behind + slow_difference(image, behind, background_pixels(person), SIZE)
    growing = neck(image, region, landmarks, profile, SIZE / 512)
    out = restore(image, region, wall, growing)
    assert np.array_equal(out[~region], image[~region])
    # Red stays below the skin's, and green above the wall's shade: no trace of 250, 0, 250.
    assert out[region][:, 0].max() <= 205
    assert out[region][:, 1].min() >= 80
    assert np.abs(out[58, 48].astype(int) - SKIN).max() < 25  # the neck goes on upwards
    assert np.abs(out[20, 48].astype(int) - WALL).max() < 5  # not into the middle of the face


def test_what_lies_beside_a_steep_jaw_goes_on_into_the_rim_of_the_hole() -> None:
    # A column of skin stands beside the inpaint mask, and nothing is below it: no neck grows there.
    image = np.tile(WALL, (512, 512, 1))
    image[100:300, 300:340] = SKIN
    person = np.zeros((512, 512), np.float32)
    person[100:300, 300:340] = 1
    region = np.zeros((512, 512), bool)
    region[100:300, 200:300] = True
    image[region] = HEAD
    nothing = np.zeros((512, 512, 3), np.float32), np.zeros((512, 512), np.float32)
    colour, share = rim(image, region, person, nothing, 1.0)
    wall = np.tile(WALL.astype(np.float32), (512, 512, 1))
    out = restore(image, region, wall, (colour, share))
    assert np.array_equal(out[~region], image[~region])
    np.testing.assert_allclose(out[150:250, 298:300], np.tile(SKIN, (100, 2, 1)), atol=8)
    np.testing.assert_allclose(out[150:250, 295:300], np.tile(SKIN, (100, 5, 1)), atol=20)
    # It fades out, and where there is wall beside the inpaint mask the wall goes on.
    np.testing.assert_array_equal(out[150:250, 289], np.tile(WALL, (100, 1)))
    np.testing.assert_allclose(out[150:250, 200:205], np.tile(WALL, (100, 5, 1)), atol=3)
    assert (share[150:250, 291:300] > 0).all()


def test_stripes_beside_a_hole_do_not_go_on_into_it() -> None:
    image = np.tile(SKIN, (512, 512, 1))
    image[::2] = SKIN // 2
    person = np.ones((512, 512), np.float32)
    region = np.zeros((512, 512), bool)
    region[100:300, 200:300] = True
    nothing = np.zeros((512, 512, 3), np.float32), np.zeros((512, 512), np.float32)
    colour, _ = rim(image, region, person, nothing, 1.0)
    assert np.abs(np.diff(colour[150:250, 295, 0])).max() < 0.2 * SKIN[0] / 2


def test_a_rim_without_a_hole_is_what_grows() -> None:
    image = np.tile(WALL, (SIZE, SIZE, 1))
    growing = np.zeros((SIZE, SIZE, 3), np.float32), np.zeros((SIZE, SIZE), np.float32)
    person = np.ones((SIZE, SIZE), np.float32)
    for region in (np.zeros((SIZE, SIZE), bool), np.ones((SIZE, SIZE), bool)):
        colour, share = rim(image, region, person, growing, SIZE / 512)
        assert not colour.any()
        assert not share.any()


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


def test_flicker_of_the_neck_is_smoothed_but_not_across_a_cut() -> None:
    rng = np.random.default_rng(0)
    profiles = np.full((60, PROFILE, 4), 100.0) + rng.normal(0, 5, (60, 1, 4))
    profiles[30:] += 80
    profiles[12] = np.nan
    profiles[:, :10] = np.nan
    smooth = smooth_profiles(profiles, np.repeat([0, 1], 30))
    assert np.isfinite(smooth).all()
    assert np.abs(np.diff(smooth[:30], axis=0)).max() < 1.5
    assert smooth[29].max() < 110
    assert smooth[30].min() > 170


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


@pytest.mark.parametrize("corner", [(0, 40), (150, 200)])
def test_what_grows_into_a_part_is_what_grows_into_the_whole(corner: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    image, person, region, landmarks = (
        np.kron(part, np.ones((4, 4) + (1,) * (part.ndim - 2), part.dtype))
        if len(part) == SIZE
        else 4 * part
        for part in scene()
    )
    image = np.clip(image + rng.integers(-20, 20, image.shape), 0, 255).astype(np.uint8)
    profile = rng.uniform(100, 120, (PROFILE, 4))
    region = np.roll(region, corner, (0, 1))
    box = extent(region, CONTEXT_PX)
    within = landmarks - (box[1].start, box[0].start)
    grown = neck(image[box], region[box], within, profile, 1.0)
    whole = neck(image, region, landmarks, profile, 1.0)
    for mine, theirs in zip(grown, whole, strict=True):
        np.testing.assert_allclose(mine[region[box]], theirs[region], rtol=1e-4, atol=1e-3)
    share = person.astype(np.float32) / 255
    mine, _ = rim(image[box], region[box], share[box], grown, 1.0)
    theirs, _ = rim(image, region, share, whole, 1.0)
    # The blocks of the averages lie otherwise: noise of 12 levels does not average out alike.
    assert np.abs(mine[region[box]] - theirs[region]).mean() < 1


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
