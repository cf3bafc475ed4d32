"""Captions and graphics over the lower face of the synthetic speakers, pixel by pixel."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import cv2
import numpy as np
import pytest

from dubbing.face.finding.landmarks import FaceMesh
from dubbing.face.mouth.lip_region import lip_region
from dubbing.media import read_frames
from dubbing.preparation.covering.occlusion import covered_step
from dubbing.preparation.covering.overlay import Overlay, overlay_step
from dubbing.preparation.covering.still_graphics import StillGraphics
from dubbing.preparation.tracking.procrustes import head_frame, mean_shape

pytestmark = pytest.mark.medium

if TYPE_CHECKING:
    from dubbing.media import MediaInfo

MEDIUM_GREY = 128
Draw = Callable[[np.ndarray, int, np.ndarray], None]


def text(words: str, colour: tuple[int, int, int], outline: bool = True) -> Draw:
    """Draws words across the chin."""

    def draw(picture: np.ndarray, _frame: int, chin: np.ndarray) -> None:
        place = (int(chin[0]) - 22, int(chin[1]) + 1)
        font = cv2.FONT_HERSHEY_DUPLEX
        if outline:
            cv2.putText(picture, words, place, font, 0.5, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(picture, words, place, font, 0.5, colour, 1, cv2.LINE_AA)

    return draw


def bar(picture: np.ndarray, _frame: int, chin: np.ndarray) -> None:
    top = int(chin[1]) - 5
    picture[top : top + 14] = (20, 40, 150)


def logo(picture: np.ndarray, _frame: int, chin: np.ndarray) -> None:
    cv2.circle(picture, (int(chin[0]) + 9, int(chin[1]) - 8), 3, (30, 220, 40), -1)


def sticker(picture: np.ndarray, _frame: int, chin: np.ndarray) -> None:
    cv2.circle(picture, (int(chin[0]), int(chin[1])), 7, (250, 210, 40), -1)


def seldom(draw: Draw) -> Draw:
    return lambda picture, frame, chin: draw(picture, frame, chin) if 6 <= frame < 13 else None


def meshes(frames: np.ndarray) -> np.ndarray:
    mesh = FaceMesh(tracking=False)
    return np.stack([mesh(frame)[0] for frame in frames])


def look(frames: np.ndarray, points: np.ndarray, out: Path) -> tuple[np.ndarray, np.ndarray]:
    """Masks (T, S, S) and over (T,) of what is found in frames."""
    shape = head_frame(mean_shape(points, tuple(range(468))))
    valid, one = np.ones(len(frames), bool), np.zeros(len(frames), int)
    views = np.tile([0.0, 0, -1], (len(frames), 1))
    light = covered_step(frames, points, valid, one, shape, views, lambda _: None)
    overlay = Overlay(frames, points, valid, one, shape, light)
    info = cast("MediaInfo", SimpleNamespace(rate=Fraction(25)))
    window = np.tile([0.0, 0, frames.shape[1]], (len(frames), 1))
    graphics = StillGraphics(frames, points, window, valid, one)
    over = overlay_step(overlay, graphics, out, info, lambda _: None)["over"]
    return np.stack(list(read_frames(out, pixels="gray"))), over


@pytest.mark.parametrize(
    "draw",
    [
        text("NOW", (255, 255, 255)),
        text("NOW", (255, 255, 0)),
        seldom(text("NOW", (255, 255, 255))),
        text("NOW", (0, 230, 60), outline=False),
        bar,
        logo,
        sticker,
    ],
    ids=["white", "yellow", "white for a moment", "green", "lower third", "logo", "sticker"],
)
@pytest.mark.parametrize("name", ["alba", "chidi"])
def test_what_lies_over_the_chin_is_found_to_the_pixel(
    people: dict[str, np.ndarray], name: str, draw: Draw, tmp_path: Path
) -> None:
    clean, frames = people[name], people[name].copy()
    points = meshes(clean)
    chin = np.median(points[:, 152, :2], 0)
    for t, picture in enumerate(frames):
        draw(picture, t, chin)
    masks, over = look(frames, points, tmp_path / "o.mkv")
    drawn = np.abs(frames.astype(int) - clean).max(-1) > MEDIUM_GREY // 2
    near = np.zeros(clean.shape[1:3], bool)
    near[: int(chin[1]) + 3, int(chin[0]) - 24 : int(chin[0]) + 24] = True
    seen = [(masks[t] > 0)[drawn[t] & near].mean() for t in np.flatnonzero(drawn.any((1, 2)))]
    assert np.min(seen) > 0.85
    assert over[drawn.any((1, 2))].all()
    lips = np.median(points[:, [13, 14], :2], (0, 1)).round().astype(int)
    assert not masks[:, lips[1], lips[0]].any()  # the mouth is dubbed


def test_between_letters_on_the_mouth_the_films_lips_do_not_stay(
    people: dict[str, np.ndarray], tmp_path: Path
) -> None:
    clean, frames = people["alba"], people["alba"].copy()
    points = meshes(clean)
    lips = np.median(points[:, [13, 14], :2], (0, 1)).round().astype(int)
    for t, picture in enumerate(frames):
        text("OXOXO", (0, 230, 60), outline=False)(picture, t, lips + np.array([-4, 5]))
    masks, over = look(frames, points, tmp_path / "o.mkv")
    assert over.all()
    letters = np.abs(frames.astype(int) - clean).max(-1) > MEDIUM_GREY // 4
    beside = np.array([cv2.dilate(one.astype(np.uint8), np.ones((3, 3))) for one in letters]) == 0
    mouths = np.array([lip_region(face[:, :2], clean.shape[1]) for face in points])
    assert (masks > 0)[letters & mouths].mean() > 0.9
    assert (masks > 0)[beside & mouths].mean() < 0.1


def test_a_pixel_of_a_captions_colour_is_no_caption(
    people: dict[str, np.ndarray], tmp_path: Path
) -> None:
    frames = people["alba"].copy()
    points = meshes(frames)
    chin, cheek = (np.median(points[:, k, :2], 0).round().astype(int) for k in (152, 192))
    for t, picture in enumerate(frames):
        text("NOW", (255, 255, 0))(picture, t, chin)
        picture[cheek[1], cheek[0]] = (255, 255, 0)
    masks, over = look(frames, points, tmp_path / "o.mkv")
    assert over.all()
    assert not masks[:, cheek[1], cheek[0]].any()


@pytest.mark.parametrize("light", [-0.75, 0.6])
def test_a_shadow_or_a_lamp_that_passes_over_a_face_is_no_thing(
    people: dict[str, np.ndarray], light: float, tmp_path: Path
) -> None:
    for name, frames in people.items():
        points = meshes(frames)
        left, right = np.median(points[:, [33, 263], 0], 0)
        columns = np.arange(frames.shape[2])
        edges = np.linspace(left, right, len(frames) // 3)
        dark = np.zeros((len(frames), len(columns)))
        dark[-len(edges) :] = 1 / (1 + np.exp((columns - edges[:, None]) / (0.1 * (right - left))))
        shaded = np.clip(frames * (1 + light * dark[:, None, :, None]), 0, 255).astype(np.uint8)
        _, over = look(shaded, points, tmp_path / f"{name}.mkv")
        assert not over.any()


@pytest.mark.parametrize("light", [1.0, 0.5, 1.3])
def test_on_a_bare_face_nothing_is_found(
    people: dict[str, np.ndarray], light: float, tmp_path: Path
) -> None:
    for name, frames in people.items():
        lit = frames.copy()
        lit[10:] = np.clip(lit[10:] * light, 0, 255)
        masks, over = look(lit, meshes(frames), tmp_path / f"{name}.mkv")
        assert not over.any()
        assert masks.shape[0] == 1  # an empty mask for all of the clip
