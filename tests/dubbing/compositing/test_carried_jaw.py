"""The film's own jaw moves with the new words, and the learned head is shown within it."""

import numpy as np
import pytest

from dubbing.compositing import carried_jaw
from dubbing.compositing.carried_jaw import CarriedHead, FilmFace, of_another_red
from dubbing.compositing.jaw_line import ANGLES
from dubbing.compositing.jaw_opening import moving_share, touching
from dubbing.face.face_contour import face_contour
from dubbing.face.mesh_points import CHIN, NOSE_TIP
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from tests import fakes

S = 512
MIDDLE = S // 2
LANDMARKS = fakes.talking_face(S)
CONTOUR = face_contour(LANDMARKS, S)
END = round(LANDMARKS[CHIN, 1])
FREE = np.zeros(S)
ALL = np.full((S, S), 255, np.uint8)
DRAWN = np.random.default_rng(0).integers(0, 256, (S // 4, S // 4, 3), dtype=np.uint8)
IMAGE = DRAWN.repeat(4, 0).repeat(4, 1)
LEARNED = (10, 200, 30)


def disc(radius: float = END - MIDDLE) -> np.ndarray:
    """A head (S, S) uint8 round the middle of the face."""
    row, column = np.mgrid[:S, :S] - MIDDLE
    soft = np.clip(0.5 + radius - np.hypot(row, column), 0, 1)
    return (255 * soft).round().astype(np.uint8)


def of_one_colour(opacity: np.ndarray) -> np.ndarray:
    """A learned head (S, S, 4) uint8."""
    alpha = opacity[..., None]
    return np.dstack([alpha / 255 * np.array(LEARNED), alpha]).round().astype(np.uint8)


def film_face(matte: np.ndarray | None = None, overlay: np.ndarray | None = None) -> FilmFace:
    """That of the round head."""
    return FilmFace(IMAGE, disc() if matte is None else matte, overlay, LANDMARKS, CONTOUR)


def moved(
    motion: tuple[float, float],
    opacity: np.ndarray,
    share: np.ndarray = ALL,
    held: np.ndarray = FREE,
    **film: np.ndarray,
) -> CarriedHead:
    """The round head with a jaw that moved."""
    return film_face(**film).carried(of_one_colour(opacity), share, np.array(motion), held, FREE)


def motion_to(
    opacity: np.ndarray, overlay: np.ndarray | None = None, offset: float = 0.0
) -> np.ndarray:
    return film_face(overlay=overlay).motion_to(opacity, np.full(len(ANGLES), offset))


@pytest.mark.parametrize("down", [-40.0, -12.0, -3.0, 4.0, 14.0])
def test_the_motion_of_a_jaw_is_found(down: float) -> None:
    opacity = moved((0, down), disc(END + 40)).head[..., 3]
    np.testing.assert_allclose(motion_to(opacity), (0, down), atol=0.1 * abs(down) + 0.3)


def test_an_outline_that_is_off_with_the_films_own_words_is_no_motion() -> None:
    assert abs(motion_to(disc(END - MIDDLE - 6))[1] + 6) < 2
    np.testing.assert_allclose(motion_to(disc(END - MIDDLE - 6), offset=6), 0, atol=0.3)


def test_a_dent_in_a_learned_chin_moves_nothing() -> None:
    dented = disc()
    dented[END - 25 :, MIDDLE - 20 : MIDDLE + 10] = 0
    np.testing.assert_allclose(motion_to(dented), 0, atol=0.5)


def test_an_outline_along_which_a_jaw_opens_moves_it_nowhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its sides say opposite things, each of them many px."""
    monkeypatch.setattr(carried_jaw, "opening_way", lambda _: np.array([1.0, 0.0]))
    np.testing.assert_allclose(motion_to(disc(END - MIDDLE + 6)), 0, atol=0.5)


def test_a_jaw_that_is_covered_stays() -> None:
    covered = np.zeros((S, S), np.uint8)
    covered[MIDDLE:] = 255
    assert not motion_to(disc(END - MIDDLE - 10), covered).any()


def test_a_jaw_opens_down_and_in_profile_backwards() -> None:
    profile = LANDMARKS.copy()
    profile[NOSE_TIP] += (180, 0)
    face = FilmFace(IMAGE, disc(), None, profile, CONTOUR)
    way = np.sign(face.motion_to(disc(END - MIDDLE + 8), None))
    assert way.tolist() == [-1, 1]


@pytest.mark.parametrize("down", [-10.0, 10.0])
def test_the_films_chin_is_shown_elsewhere(down: float) -> None:
    made = moved((0, down), disc(END - MIDDLE + down))
    chin = np.s_[END - 14 : END - 4, MIDDLE - 10 : MIDDLE + 10]
    there = np.roll(made.head[..., :3], -round(down), 0)[chin]
    assert np.abs(there.astype(int) - IMAGE[chin]).max() <= 12
    assert made.share[END - 14, MIDDLE] == 255
    assert made.kept[END - 15, MIDDLE] == 1
    outline = np.flatnonzero(made.head[:, MIDDLE, 3] > 127)[-1]
    assert outline == pytest.approx(END + down, abs=1)


def test_lips_are_those_of_the_learned_head_and_what_is_above_the_films() -> None:
    made = moved((0, 8), disc())
    x, y = LANDMARKS[list(OUTER_LIP)].mean(0).round().astype(int)
    assert tuple(made.head[y, x]) == (*LEARNED, 255)
    assert made.kept[y, x] == 0
    away = moving_share(LANDMARKS, np.arange(S), np.arange(S)[:, None]) == 0
    assert not moved((0, 0), disc(), 0 * ALL).share.any()
    nothing_learned = moved((0, 8), disc(), 0 * ALL)
    assert not nothing_learned.share[away].any()
    assert nothing_learned.share.any()


def test_a_jaw_that_does_not_move_is_the_films_to_the_bit() -> None:
    made = moved((0, 0), disc(), 0 * ALL)
    inside = made.kept == 1
    assert inside[END - 10, MIDDLE]
    np.testing.assert_array_equal(made.head[inside][:, :3], IMAGE[inside])


def test_what_lies_over_the_jaw_does_not_move_with_it() -> None:
    """Behind its edge the film's skin goes on, as it was inpainted; deep below nothing is known."""
    overlay = np.zeros((S, S), np.uint8)
    overlay[END - 70 : END - 10, MIDDLE - 60 : MIDDLE + 60] = 255
    made = moved((0, 30), disc(END - MIDDLE + 30), overlay=overlay)
    assert not made.share[overlay == 255].any()
    # Where its pixels would come to lie.
    assert (made.head[END - 10 : END, MIDDLE, :3] == LEARNED).all()
    edge = made.head[END + 13 : END + 19, MIDDLE, :3]
    np.testing.assert_array_equal(edge, IMAGE[END - 17 : END - 11, MIDDLE])


def test_what_a_matte_holds_beside_the_face_stays_where_it_is() -> None:
    """A collar, or a shoulder: neither the mesh nor the learned head has it."""
    matte = disc()
    matte[END + 29 : END + 45, MIDDLE - 30 : MIDDLE + 30] = 255
    made = moved((0, -8), disc(), matte=matte)
    collar = np.s_[END + 29 : END + 45, MIDDLE - 30 : MIDDLE + 30]
    assert not made.share[collar].any()
    assert not made.head[END + 22, MIDDLE, 3]


def test_clothes_that_a_chin_touches_do_not_rise_with_it() -> None:
    """A matte that was cut too low holds them, next to the chin."""
    image = np.full((S, S, 3), (200, 150, 120), np.uint8)
    shirt = np.s_[END + 1 : END + 11, MIDDLE - 30 : MIDDLE + 30]
    opacity = {}
    for name, colour in (("shirt", (40, 60, 120)), ("skin", (190, 140, 110))):
        matte = disc()
        matte[shirt], image[shirt] = 255, colour
        face = FilmFace(image, matte, None, LANDMARKS, CONTOUR)
        head = of_one_colour(disc(END - MIDDLE - 16))
        made = face.carried(head, ALL, np.array([0, -16.0]), FREE, FREE)
        opacity[name] = made.head[END - 12 : END - 6, MIDDLE - 10 : MIDDLE + 10, 3]
    assert opacity["shirt"].max() < 40
    assert opacity["skin"].min() > 200


def test_a_collar_that_the_film_shows_beside_a_chin_is_not_replaced() -> None:
    """What is restored behind a head is never quite it."""
    image = np.full((S, S, 3), (200, 150, 120), np.uint8)
    collar = np.s_[END + 3 : END + 12, MIDDLE - 20 : MIDDLE + 20]
    image[collar] = (230, 230, 240)
    face = FilmFace(image, disc(), None, LANDMARKS, CONTOUR)
    for down in (-10.0, 8.0):
        made = face.carried(of_one_colour(disc()), ALL, np.array([0, down]), FREE, FREE)
        seen = made.share[END + 5 : END + 11, MIDDLE - 15 : MIDDLE + 15]
        covered = made.head[END + 5 : END + 11, MIDDLE - 15 : MIDDLE + 15, 3]
        assert seen[covered == 0].max(initial=0) < 30
        assert (covered.max() > 200) == (down > 0)
    # A neck in the shade may be no redder than that; the old chin's edge must not stay on it.
    neck = face.carried(of_one_colour(disc()), ALL, np.array([0, -10.0]), FREE, np.ones(S))
    assert neck.share[END + 5 : END + 11, MIDDLE - 15 : MIDDLE + 15].min() > 200


def test_clothes_within_a_mattes_edge_stay_below_a_chin_that_comes_off_them() -> None:
    """The learned chin may lie below them."""
    image = np.full((S, S, 3), (200, 150, 120), np.uint8)
    shirt = np.s_[END - 4 : END + 40]
    image[shirt] = (40, 60, 120)
    turned = LANDMARKS.copy()
    turned[NOSE_TIP] += (160, 0)
    seen = []
    for landmarks in (LANDMARKS, turned):
        face = FilmFace(image, disc(), None, landmarks, CONTOUR)
        made = face.carried(of_one_colour(disc()), ALL, np.array([0, -10.0]), FREE, FREE)
        seen.append(made.kept[END - 12, MIDDLE - 10 : MIDDLE + 10].max())
    assert seen[0] > 0.9
    assert seen[1] < 0.1


@pytest.mark.parametrize(
    ("down", "turn", "expected"),
    [(-8.0, 0.0, 1.0), (8.0, 0.0, 0.0), (-30.0, 0.0, 0.0), (-8.0, 160.0, 0.0)],
)
def test_a_chin_that_rises_a_little_stays_on_clothes(
    down: float, turn: float, expected: float
) -> None:
    """One that falls covers them; behind a head that turns other frames show the wall."""
    face = LANDMARKS.copy()
    face[NOSE_TIP] += (turn, 0)
    assert touching(np.array([0, down]), face, S) == expected


def test_what_is_held_does_not_move() -> None:
    held = np.zeros(S)
    held[:MIDDLE] = 1
    made = moved((0, -10), disc(), held=held)
    ends = [np.flatnonzero(made.head[:, MIDDLE + k, 3] > 127)[-1] for k in (-12, 12)]
    assert ends[0] - ends[1] == pytest.approx(10, abs=1)


def test_a_mouth_outside_of_the_picture_changes_nothing() -> None:
    away = LANDMARKS + np.array([3 * S, 0])
    face = FilmFace(IMAGE, disc(), None, away, face_contour(away, S))
    assert not face.motion_to(disc(), None).any()
    assert not face.carried(of_one_colour(disc()), ALL, np.zeros(2), FREE, FREE).share.any()


def test_deep_shade_on_dark_skin_is_no_cloth() -> None:
    face = np.zeros((24, 24), bool)
    face[:12] = True
    for skin, below, other in (
        ((72, 46, 30), (13, 10, 12), False),  # the shade of its chin
        ((200, 130, 110), (30, 30, 36), True),  # a black shirt
        ((200, 130, 110), (230, 230, 240), True),
        ((72, 46, 30), (230, 230, 240), True),
    ):
        image = np.full((24, 24, 3), skin, np.uint8)
        image[12:] = below
        found = of_another_red(image, face)
        assert not found[:11].any()
        assert (found[13:] == other).all()
