"""The neck that a closing jaw uncovers."""

from itertools import pairwise

import numpy as np

from dubbing.compositing.neck import Neck, bottom, with_neck
from dubbing.face.face_contour import FaceContour, face_contour
from tests import fakes

S = 256
SKIN, GROWN, SHIRT, WALL = (200, 130, 110), (90, 90, 90), (230, 230, 240), (20, 60, 120)
FILM, COLLAR = 100, 125  # px from the middle: the film's open jaw, and where a shirt begins


def disc(radius: float) -> np.ndarray:
    """A head (S, S) uint8 of that radius."""
    rows, columns = np.mgrid[:S, :S] - S / 2
    soft = np.clip(0.5 + radius - np.hypot(rows, columns), 0, 1)
    return (255 * soft).round().astype(np.uint8)


def scene(collar: float = COLLAR) -> tuple[np.ndarray, np.ndarray, np.ndarray, FaceContour]:
    """Film, background, matte and contour of an open jaw above a neck with a line in it."""
    rows, columns = np.mgrid[:S, :S] - S / 2
    radius = np.hypot(rows, columns)
    image = np.empty((S, S, 3), np.uint8)
    image[:] = np.where((rows > 0)[..., None], SKIN, WALL)
    image[(radius > FILM + 8) & (radius < FILM + 11) & (rows > 0)] = (160, 100, 80)
    image[(radius > collar) & (rows > 0)] = SHIRT
    image[radius < FILM] = SKIN
    background = image.copy()
    background[radius < FILM + 4] = GROWN
    return image, background, disc(FILM), face_contour(fakes.face(S), S)


def test_the_films_neck_reaches_up_to_a_chin_that_is_higher() -> None:
    image, background, matte, contour = scene()
    made, where = with_neck(image, background, Neck.of(image, matte, contour), disc(90))
    below = made[:, S // 2].astype(int)  # down from the middle of the face
    at = S // 2
    assert np.abs(below[at + 91 : at + 95] - SKIN).max() < 4  # grey before
    # The line in the neck went up, by less than the chin did.
    line = np.abs(below[at + 90 : at + 120] - SKIN).sum(1).argmax() + 90
    assert 100 < line < FILM + 8
    # The shirt stays where it is, and so does all beside the jaw.
    radius = np.hypot(*(np.mgrid[:S, :S] - S / 2))
    np.testing.assert_array_equal(made[radius > COLLAR + 1], background[radius > COLLAR + 1])
    np.testing.assert_array_equal(made[: S // 2], background[: S // 2])
    np.testing.assert_array_equal(made[~where], background[~where])
    assert not where[: S // 2].any()


def test_a_chin_that_is_lower_pushes_the_neck_down() -> None:
    image, background, matte, contour = scene()
    made, _ = with_neck(image, background, Neck.of(image, matte, contour), disc(FILM + 9))
    below = made[S // 2 :, S // 2].astype(int)
    # The film's chin would cover the line.
    line = np.abs(below[FILM + 9 : COLLAR - 5] - SKIN).sum(1).argmax() + FILM + 9
    assert line in range(FILM + 11, COLLAR - 6)
    assert (below[COLLAR + 1 :] == SHIRT).all()


def test_a_deep_shadow_in_the_middle_of_a_neck_is_neck() -> None:
    """As on dark skin: on both sides of it, and below it, there is neck."""
    image, background, matte, contour = scene()
    rows, columns = np.mgrid[:S, :S] - S / 2
    radius = np.hypot(rows, columns)
    image[(radius > FILM) & (radius < FILM + 8) & (np.abs(columns) < 12) & (rows > 0)] = (
        20,
        14,
        14,
    )
    neck = Neck.of(image, matte, contour)
    middle = slice(S // 2 - 30, S // 2 + 30)
    assert neck.room[middle].min() > COLLAR - FILM - 12
    made, _ = with_neck(image, background, neck, disc(90))
    assert (made[S // 2 + 92, middle] != GROWN).any(1).all()


def test_a_neck_that_a_lamp_from_the_side_leaves_dark_is_neck() -> None:
    image, background, matte, contour = scene()
    dark = np.where(np.arange(S) > S / 2, 0.15, 1.0)[:, None]
    image, background = ((one * dark).round().astype(np.uint8) for one in (image, background))
    neck = Neck.of(image, matte, contour)
    half = slice(S // 2 + 20, S // 2 + 38)
    assert (neck.room[half] > 0.7 * neck.room[S // 2 - 30]).all()
    made, _ = with_neck(image, background, neck, disc(90))
    below = made[S // 2 + 92, half].astype(int)
    assert np.abs(below - 0.15 * np.array(SKIN)).max() < 6


def test_a_chin_on_the_collar_changes_nothing() -> None:
    image, background, matte, contour = scene()
    made, where = with_neck(image, background, Neck.of(image, matte, contour), disc(COLLAR - 3))
    below = slice(S // 2 - 60, S // 2 + 60)
    np.testing.assert_array_equal(made[:, below], background[:, below])
    assert not where[:, below].any()


def test_a_collar_right_below_the_chin_is_not_pulled_up() -> None:
    image, background, matte, contour = scene(collar=FILM + 4)
    made, where = with_neck(image, background, Neck.of(image, matte, contour), disc(90))
    below = slice(S // 2 - 60, S // 2 + 60)  # further beside, the neck goes on along a column
    np.testing.assert_array_equal(made[:, below], background[:, below])
    assert not where[:, below].any()


def test_without_a_head_the_background_stays() -> None:
    image, background, matte, contour = scene()
    nothing = np.zeros((S, S), np.uint8)
    for film, head in ((matte, nothing), (nothing, disc(90)), (nothing, nothing)):
        made, where = with_neck(image, background, Neck.of(image, film, contour), head)
        np.testing.assert_array_equal(made, background)
        assert not where.any()


def test_it_moves_as_smoothly_as_the_chin() -> None:
    image, background, matte, contour = scene()
    film = image.astype(int)
    chins = np.linspace(88, FILM + 2, 29)
    seen = [with_neck(image, background, Neck.of(image, matte, contour), disc(r))[0] for r in chins]
    below = [made.astype(int)[S // 2 + 110 :] for made in seen]  # under every chin
    jumps = [np.abs(b - a).mean() for a, b in pairwise(below)]
    assert max(jumps) < 0.5
    assert np.abs(below[-1] - film[S // 2 + 110 :]).mean() < 0.01


def test_beside_the_neck_the_wall_stays() -> None:
    """A jaw is wider than a neck: what it uncovers beside the neck is no skin."""
    image, background, matte, contour = scene(collar=180)
    column = np.arange(S)
    beside = np.abs(column - S // 2) > 50
    image[:, beside] = np.where((matte[:, beside] > 127)[..., None], SKIN, WALL)
    background[:, beside] = WALL
    made, _ = with_neck(image, background, Neck.of(image, matte, contour), disc(85))
    np.testing.assert_array_equal(made[:, beside], background[:, beside])
    inside = np.abs(column - S // 2) < 40
    rows = np.mgrid[:S, :S][0] - S / 2
    radius = np.hypot(rows, np.mgrid[:S, :S][1] - S / 2)
    uncovered = (radius > 87) & (radius < FILM + 3) & (rows > 0) & inside
    skin = np.abs(made.astype(int) - SKIN).max(2)
    assert np.mean(skin[uncovered] < 45) > 0.95  # as dark as the line in the neck


def test_a_neck_that_a_shirt_lights_is_a_neck() -> None:
    """In the shade its skin is less red than the face; the shirt is less red, and brighter."""
    image, background, matte, contour = scene()
    left = np.mgrid[:S, :S][1] < S // 2
    image[(image == SKIN).all(2) & (matte == 0) & left] = (140, 115, 104)
    made, where = with_neck(image, background, Neck.of(image, matte, contour), disc(90))
    for column in range(S // 2 - 30, S // 2 + 30, 5):
        assert where[S // 2 + 92, column]
        assert np.abs(made[S // 2 + 94, column].astype(int) - GROWN).sum() > 60
    assert not where[S // 2 + COLLAR + 2 :].any()


def test_a_shadow_under_the_chin_is_neck_and_a_gap_under_a_collar_is_not() -> None:
    rows = np.arange(S)[:, None] - S / 2
    for shirt, neck in ((COLLAR + 20, True), (FILM + 12, False)):
        image, _, matte, contour = scene(collar=shirt)
        radius = np.hypot(rows, np.arange(S) - S / 2)
        image[(matte == 0) & (rows > 0) & (radius < FILM + 12)] = (64, 48, 44)
        found = Neck.of(image, matte, contour)
        middle = slice(S // 2 - 30, S // 2 + 30)
        assert (found.share[middle] > 0.9).all() == neck
        assert (found.share[middle] < 0.1).all() != neck


def test_columns_that_look_like_neck_alone_draw_no_stripes() -> None:
    image, _, matte, contour = scene(collar=FILM + 4)
    for column in range(S // 2 - 40, S // 2 + 40, 16):
        image[S // 2 + FILM :, column : column + 7] = SKIN
    found = Neck.of(image, matte, contour)
    middle = slice(S // 2 - 40, S // 2 + 40)
    assert not found.share[middle].any()
    assert (found.clothes[middle] > 0.9).all()


def test_the_edge_of_a_neck_is_not_stretched() -> None:
    """The last columns of one that turns hold what shades it."""
    image, background, matte, contour = scene()
    image[S // 2 + FILM - 8 :, S // 2 + 18 : S // 2 + 20] = (60, 45, 40)
    image[:, S // 2 + 20 :] = background[:, S // 2 + 20 :] = WALL
    made, _ = with_neck(image, background, Neck.of(image, matte, contour), disc(80), turned=1.0)
    risen = made[S // 2 + 84, S // 2 : S // 2 + 19].astype(int)
    assert np.abs(risen[:12] - SKIN).max() < 20
    assert risen[12:].sum(1).min() > np.sum(SKIN) / 2


def test_a_narrow_strip_of_skin_is_no_neck() -> None:
    """As a strand of hair or the edge of a hand has its colour: a line would show up to the jaw."""
    image, background, matte, contour = scene(collar=FILM + 4)
    image[S // 2 + FILM :, S // 2 + 2 : S // 2 + 6] = SKIN
    made, where = with_neck(image, background, Neck.of(image, matte, contour), disc(90))
    below = slice(S // 2 - 60, S // 2 + 60)
    np.testing.assert_array_equal(made[:, below], background[:, below])
    assert not where[:, below].any()


def test_the_lower_end_of_a_head_is_found_between_pixels() -> None:
    found = bottom(disc(77.5))
    across = np.abs(np.arange(S) - S / 2) < 60
    truth = S / 2 + np.sqrt(77.5**2 - (np.arange(S)[across] - S / 2) ** 2)
    assert np.abs(found[across] - truth).max() < 0.5
    assert not found[:40].any()
    touching = np.full((S, S), 255, np.uint8)
    assert (bottom(touching) == S - 1).all()
