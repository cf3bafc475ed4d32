from dataclasses import replace

import numpy as np
import pytest

from dubbing.compositing import composite as module
from dubbing.compositing.composite import blend, composite, replacement
from dubbing.compositing.face_mask import rendered_region
from dubbing.face.mesh_points import NOSE_BASE
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.preparation.film_frame import FilmFrame
from tests import fakes

S = 512
ALL = np.full((S, S), 255, np.uint8)


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A noisy picture with a round inpaint mask, its background, and a head inside of that."""
    noise = np.random.default_rng(0)
    image = noise.integers(0, 256, (S, S, 3), dtype=np.uint8)
    rows, columns = np.mgrid[0:S, 0:S] - S // 2
    radius = np.hypot(rows, columns)
    inpaint_mask = radius < 108
    background = image.copy()
    background[inpaint_mask] = (0, 100, 0)
    head = np.zeros((S, S, 4), np.uint8)
    head[radius < 100] = (220, 20, 60, 255)
    head[(radius >= 100) & (radius < 102)] = (110, 10, 30, 128)  # premultiplied
    return image, background, inpaint_mask, head


def film(
    image: np.ndarray, matte: np.ndarray, background: np.ndarray, overlay: np.ndarray | None = None
) -> FilmFrame:
    """A frame of a film with the fake face, in the usual light."""
    quiet, still = np.zeros(5), np.zeros(2)
    light = np.zeros(3)
    return FilmFrame(image, matte, background, overlay, light, quiet, still, fakes.face(S), image)


def test_composite_is_colour_plus_the_rest_of_the_background() -> None:
    _, background, inpaint_mask, head = scene()
    picture, mask = composite(background, inpaint_mask, head, ALL)
    assert tuple(picture[S // 2, S // 2]) == (220, 20, 60)
    assert mask[S // 2, S // 2] == 255
    half = (S // 2, S // 2 + 101)  # 110 + (1 - 128 / 255) * 0, 10 + ... * 100, 30
    assert tuple(picture[half]) == (110, 60, 30)
    just_outside_the_head = (S // 2, S // 2 + 104)
    assert tuple(picture[just_outside_the_head]) == (0, 100, 0)


def test_outside_of_hole_and_head_every_pixel_is_the_sources() -> None:
    image, background, inpaint_mask, head = scene()
    head[40:60, 200:300] = (9, 9, 9, 255)  # a chin lower than the inpaint mask, say
    picture, mask = composite(background, inpaint_mask, head, ALL)
    outside = ~inpaint_mask & (head[..., 3] == 0)
    assert (mask[outside] == 0).all()
    np.testing.assert_array_equal(blend(image, picture, mask)[outside], image[outside])


def test_what_speech_does_not_change_stays_as_it_is() -> None:
    image, background, inpaint_mask, head = scene()
    share = ALL.copy()
    share[: S // 2] = 0
    share[S // 2 : S // 2 + 20] = 100
    picture, mask = composite(background, inpaint_mask, head, share)
    shown = blend(image, picture, mask)
    np.testing.assert_array_equal(shown[: S // 2], image[: S // 2])
    assert mask[S // 2 + 10, S // 2] == 100
    assert tuple(shown[S // 2 + 50, S // 2]) == (220, 20, 60)


def test_the_seam_is_feathered() -> None:
    _, background, inpaint_mask, head = scene()
    _, mask = composite(background, inpaint_mask, head, ALL)
    profile = mask[S // 2, S // 2 :].astype(int)
    steps = np.diff(profile)
    assert (steps <= 0).all()
    assert np.abs(steps).max() < 60
    soft = (profile > 0) & (profile < 255)
    assert 4 <= soft.sum() <= 8
    # It ends before the old head begins: the inpaint mask is 8 px wider than that.
    assert profile[100] == 255


def test_without_a_head_the_background_stays() -> None:
    _, background, inpaint_mask, head = scene()
    picture, mask = composite(background, inpaint_mask, np.zeros_like(head), ALL)
    np.testing.assert_array_equal(picture, background)
    assert mask[S // 2, S // 2] == 255


@pytest.mark.parametrize(("jaw", "kept"), [(168, True), (135, False)])
def test_below_a_jaw_that_is_a_little_higher_the_films_skin_shows(jaw: int, kept: bool) -> None:
    """Clothes touch it. Under one that is much higher what lies behind it shows."""
    radius = np.hypot(*(np.mgrid[:S, :S] - S // 2))
    skin, shirt = np.full((S, S, 3), (220, 150, 130), np.uint8), np.full((S, S, 3), 40, np.uint8)
    matte = np.where(radius < 172, 255, 0).astype(np.uint8)
    image = np.where(radius[..., None] < 172, skin, shirt).astype(np.uint8)
    opacity = np.where(radius < jaw, 255, 0).astype(np.uint8)[..., None]
    head = np.concatenate([skin * (opacity > 0), opacity], 2).astype(np.uint8)
    frame = replace(film(image, matte, shirt), landmarks=fakes.talking_face(S))
    shown = blend(image, *replacement(frame, head)[:2])
    assert (shown[S // 2 + 169, S // 2, 0] > 180) == kept


def test_above_the_lower_face_every_pixel_is_the_films() -> None:
    image, background, _, head = scene()
    matte = np.where(np.hypot(*(np.mgrid[:S, :S] - S // 2)) < 100, 255, 0).astype(np.uint8)
    landmarks = fakes.face(S)
    picture, mask, _ = replacement(film(image, matte, background), head)
    eyes, base = landmarks[33, 1], landmarks[2, 1]
    below_the_eyes = round(eyes + 0.4 * (base - eyes))
    shown = blend(image, picture, mask)
    np.testing.assert_array_equal(shown[:below_the_eyes], image[:below_the_eyes])
    assert tuple(shown[S // 2 + 30, S // 2]) == (220, 20, 60)


def test_a_head_that_ends_too_early_leaves_the_films_nose_and_not_its_lips() -> None:
    image, background, _, head = scene()
    matte = np.where(np.hypot(*(np.mgrid[:S, :S] - S // 2)) < 100, 255, 0).astype(np.uint8)
    head[:, S // 2 + 10 :] = 0
    points = fakes.talking_face(S)
    points[list(OUTER_LIP)] -= (0, 110)  # close to the nose
    frame = replace(film(image, matte, background), landmarks=points)
    shown = blend(image, *replacement(frame, head)[:2])
    nose, lips = round(points[NOSE_BASE, 1]) - 3, round(points[list(OUTER_LIP), 1].mean())
    np.testing.assert_array_equal(shown[nose, S // 2 + 30], image[nose, S // 2 + 30])
    assert tuple(shown[lips, S // 2 + 30]) == (0, 100, 0)


def test_a_neck_that_is_stretched_is_the_films_own_and_gets_no_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    image, background, _, head = scene()
    matte = np.where(np.hypot(*(np.mgrid[:S, :S] - S // 2)) < 100, 255, 0).astype(np.uint8)
    head[S // 2 + 20 :] = 0  # a jaw that is much higher
    frame = replace(film(image, matte, background), landmarks=fakes.talking_face(S))
    shown = []
    for stretched in (False, True):
        neck = np.full((S, S), stretched)
        monkeypatch.setattr(module, "with_neck", lambda _, under, *__, neck=neck: (under, neck))
        _, mask, new = replacement(frame, head)
        shown.append(new[(mask > 100) & (matte > 0)].astype(int))
    assert shown[1].sum() < 0.9 * shown[0].sum()


def test_haze_of_a_learned_head_and_what_floats_beside_it_are_not_seen() -> None:
    _, _, _, head = scene()
    image, background = (np.full((S, S, 3), grey, np.uint8) for grey in (150, 60))
    matte = np.where(np.hypot(*(np.mgrid[:S, :S] - S // 2)) < 100, 255, 0).astype(np.uint8)
    hazy = head.copy()
    hazy[head[..., 3] == 0] = (3, 3, 3, 3)
    hazy[400:415, 60:75] = 255
    frame = film(image, matte, background)
    shown, expected = (blend(image, *replacement(frame, x)[:2]) for x in (hazy, head))
    assert np.abs(shown.astype(int) - expected).max() <= 3


def test_blend_mixes() -> None:
    image, picture = np.full((2, 2, 3), 100, np.uint8), np.full((2, 2, 3), 200, np.uint8)
    mask = np.array([[0, 51], [128, 255]], np.uint8)
    assert blend(image, picture, mask)[..., 0].tolist() == [[100, 120], [150, 200]]


def test_an_empty_hole_and_an_empty_head() -> None:
    image = scene()[0]
    nothing = np.zeros((S, S), bool)
    picture, mask = composite(image, nothing, np.zeros((S, S, 4), np.uint8), ALL)
    assert not mask.any()
    np.testing.assert_array_equal(blend(image, picture, mask), image)


def test_what_lies_beyond_the_rendered_region_changes_nothing() -> None:
    image, background, _, head = scene()
    rows, columns = np.mgrid[0:S, 0:S] - S // 2
    matte = np.where(np.hypot(rows, columns) < 120, 255, 0).astype(np.uint8)  # an open jaw
    image[(rows > 0) & (matte == 0)] = (200, 130, 110)
    head[(np.abs(columns) < 90) & (rows > -150) & (rows < 0)] = (60, 40, 20, 255)  # and hair
    landmarks = fakes.face(S)
    region = rendered_region(landmarks, S)
    assert (head[~region][:, 3] > 0).sum() > 1000
    frame = film(image, matte, background)
    whole = replacement(frame, head)[:2]
    part = replacement(frame, head * region[..., None])[:2]
    shown, again = (blend(image, *made) for made in (whole, part))
    assert (shown != blend(image, background, whole[1])).any()
    np.testing.assert_array_equal(again, shown)


def test_what_lies_over_the_face_stays_and_the_rest_is_replaced() -> None:
    image, background, _, head = scene()
    matte = np.where(np.hypot(*(np.mgrid[:S, :S] - S // 2)) < 100, 255, 0).astype(np.uint8)
    overlay = np.zeros((S, S), np.uint8)
    overlay[S // 2 + 40 : S // 2 + 60, S // 2 - 30 : S // 2 + 30] = 255
    overlay[S // 2 + 60, S // 2 - 30 : S // 2 + 30] = 100
    picture, mask, _ = replacement(film(image, matte, background, overlay), head)
    shown = blend(image, picture, mask)
    np.testing.assert_array_equal(shown[overlay == 255], image[overlay == 255])
    assert mask[S // 2 + 60, S // 2] == 155
    assert tuple(shown[S // 2 + 30, S // 2]) == (220, 20, 60)


def test_a_face_of_which_nothing_is_replaced_stays() -> None:
    image, background, _, head = scene()
    whole = np.full((S, S), 255, np.uint8)  # something lies over all of it
    _, mask, _ = replacement(film(image, np.zeros((S, S), np.uint8), background, whole), head)
    assert not mask.any()


def test_a_mouth_outside_of_the_picture_is_not_replaced() -> None:
    image, background, _, head = scene()
    frame = film(image, np.zeros((S, S), np.uint8), background)
    _, mask, _ = replacement(replace(frame, landmarks=frame.landmarks + 3 * S), head)
    assert not mask.any()
