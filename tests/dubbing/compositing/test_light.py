"""The light of a film on a rendered head, on skin that is known."""

import cv2
import numpy as np
import pytest

from dubbing.compositing import light
from dubbing.compositing.light import follow_light
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from tests import fakes

S = 256
CLEAR = np.zeros(3)


def skin(mouth: float = 70.0) -> np.ndarray:
    """A face (S, S, 3) float with soft shading, nostrils, and a mouth of that brightness."""
    rows, columns = np.mgrid[0:S, 0:S] / S
    shade = 150 + 30 * np.cos(3 * columns) * np.sin(2 * rows)
    picture = np.stack([shade + 40, shade, shade - 20], -1)
    for side in (-12, 12):
        cv2.circle(picture, (S // 2 + side, 100), 4, (80.0, 50.0, 45.0), -1)
    cv2.ellipse(picture, (S // 2, 150), (30, 10), 0, 0, 360, (mouth + 60, mouth, mouth), -1)
    return picture


def landmarks() -> np.ndarray:
    points = fakes.face(S)
    angle = np.linspace(0, 2 * np.pi, len(OUTER_LIP), endpoint=False)
    points[list(OUTER_LIP)] = np.stack([S / 2 + 34 * np.sin(angle), 150 - 14 * np.cos(angle)], -1)
    return points


ROUND = np.hypot(*(np.mgrid[0:S, 0:S] - S / 2)) < 100
OPAQUE = np.where(ROUND, 255, 0).astype(np.uint8)


def head(picture: np.ndarray) -> np.ndarray:
    colour = np.clip(picture, 0, 255).round() * ROUND[..., None]
    return np.concatenate([colour, OPAQUE[..., None]], -1).astype(np.uint8)


def follow(film: np.ndarray, render: np.ndarray, haze: np.ndarray = CLEAR) -> np.ndarray:
    image = np.clip(film, 0, 255).round().astype(np.uint8)
    return follow_light(image, OPAQUE, head(render), landmarks(), haze)


INNER = cv2.erode(OPAQUE, np.ones((21, 21))) > 0


@pytest.mark.parametrize(
    "lamp",
    [
        np.array(1.0),
        np.array(0.25),
        np.array(0.02),
        np.array([1.1, 0.9, 0.6]),
        np.linspace(0.5, 1.1, S)[:, None] * np.ones(3),
        np.array(1.6),
        np.array([3.0, 2.6, 2.2]),
    ],
    ids=["the same", "a fade", "nearly black", "a colour", "a side lamp", "bright", "a flash"],
)
def test_a_head_has_the_light_of_the_film(lamp: np.ndarray) -> None:
    """Its mouth is another than the film's, and is lit like the skin round it."""
    made = follow(skin(mouth=30) * lamp, skin(mouth=90))
    expected = np.clip(skin(mouth=90) * lamp, 0, 255)
    away = np.abs(made[..., :3].astype(float) - expected)[INNER]
    assert np.percentile(away, 95) < 4
    assert away.mean() < 1.5


@pytest.mark.parametrize("edge", [-25, 25])
def test_a_shadow_that_falls_on_a_part_of_the_face_falls_on_its_mouth(edge: int) -> None:
    columns = np.arange(S) - S / 2
    shadow = (1 - 0.6 / (1 + np.exp((columns - edge) / 6)))[:, None] * np.ones(3)
    made = follow(skin(mouth=30) * shadow, skin(mouth=90))
    expected = np.clip(skin(mouth=90) * shadow, 0, 255)
    away = np.abs(made[..., :3].astype(float) - expected)[INNER]
    assert away.mean() < 5.5
    assert np.percentile(away, 95) < 20


def test_in_light_from_another_side_a_nose_has_its_shade_there() -> None:
    """The learned head has it on the other side, and shades of cheeks beside the mouth."""
    shades = np.ones((2, S, S, 1))
    for rows, columns in (((70, 112), (104, 122)), ((110, 170), (48, 66)), ((60, 90), (60, 84))):
        shades[0, slice(*rows), slice(*columns)] = 0.5
    shades[1] = shades[0, :, ::-1]
    there, here = (cv2.GaussianBlur(shade, (0, 0), 4)[..., None] for shade in shades)
    made = follow(skin(mouth=30) * here, skin(mouth=90) * there)
    away = np.abs(made[..., :3] - np.clip(skin(mouth=90) * here, 0, 255)).max(-1)
    before = np.abs(skin(mouth=90) * (here - there)).max(-1)
    assert away[INNER].mean() < 0.4 * before[INNER].mean()
    assert away[130:170, 90:166].mean() < 6  # no light is made up where words decide


@pytest.mark.parametrize("chin", [0.5, 1.6])
def test_a_chin_that_moves_is_no_shadow(chin: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """What differs below the mouth alone is followed slowly, as any light is."""
    film = skin(mouth=30)
    film[175:] *= chin
    made = follow(film, skin(mouth=90))
    monkeypatch.setattr(light, "SHADOWS", ())
    slowly = follow(film, skin(mouth=90))
    assert np.abs(made.astype(int) - slowly).max() <= 2


def test_a_mouth_that_opens_beyond_the_film_s_lips_stays_dark() -> None:
    """In light from the side, in which shadows are followed: what is dark there is no shadow."""
    columns = np.arange(S) - S / 2
    shadow = (1 - 0.6 / (1 + np.exp(columns / 6)))[:, None] * np.ones(3)
    render = skin(mouth=30)
    cv2.ellipse(render, (S // 2 + 16, 168), (16, 6), 0, 0, 360, (40.0, 20.0, 20.0), -1)
    made = follow(skin(mouth=90) * shadow, render)[..., :3].astype(float)
    closed = follow(skin(mouth=90) * shadow, skin(mouth=30))[..., :3].astype(float)
    assert made[165:171, 138:150].mean() < 40
    beside = np.s_[178:184, 130:158]
    assert np.abs(made[beside] - closed[beside]).max() < 12


def test_in_a_fade_to_white_the_mouth_pales_as_the_face_does() -> None:
    white = 0.6
    haze = np.full(3, 255 * white)
    made = follow(skin(30) * (1 - white) + haze, skin(90), haze)
    expected = skin(90) * (1 - white) + haze
    assert np.abs(made[..., :3] - expected)[INNER].mean() < 2


def test_what_lies_over_the_face_is_no_light() -> None:
    film = skin()
    film[160:190, 60:200] = 250
    overlay = np.zeros((S, S), np.uint8)
    overlay[158:192, 58:202] = 255
    image = film.round().astype(np.uint8)
    made = follow_light(image, OPAQUE, head(skin()), landmarks(), CLEAR, overlay)
    assert np.abs(made[..., :3] - skin())[INNER].max() < 4


def test_a_mouth_pales_in_a_frame_so_pale_that_nobody_is_found_in_it() -> None:
    white, nobody = 0.97, np.zeros((S, S), np.uint8)
    haze = np.full(3, 255 * white)
    image = (skin(30) * (1 - white) + haze).round().astype(np.uint8)
    made = follow_light(image, nobody, head(skin(90)), landmarks(), haze)
    assert np.abs(made[..., :3] - (skin(90) * (1 - white) + haze))[INNER].mean() < 3


def test_a_head_of_which_nothing_but_lips_is_seen_stays() -> None:
    render = head(skin())
    render[:138] = render[162:] = render[:, :96] = render[:, 160:] = 0
    image = np.full((S, S, 3), 10, np.uint8)
    np.testing.assert_array_equal(follow_light(image, OPAQUE, render, landmarks(), CLEAR), render)


def test_light_is_steady_where_the_film_is() -> None:
    rng = np.random.default_rng(0)
    film = [skin() + rng.normal(0, 3, (S, S, 3)) for _ in range(6)]
    made = np.stack([follow(picture, skin()) for picture in film]).astype(float)
    assert made.std(0)[INNER].mean() < 0.3
