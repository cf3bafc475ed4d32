"""Graphics that stand still, most of them see-through, while a painted face moves under them."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from dubbing.face.mesh_points import CHIN, FACE_OVAL, LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER
from dubbing.preparation.covering.still_graphics import APART, StillGraphics

SIZE, EYES, FRAMES = 200, 60, 50
CENTRE = np.array([100.0, 90.0])
Draw = Callable[[np.ndarray], None]


def face() -> tuple[np.ndarray, np.ndarray]:
    """A picture with a face on a wall, twice as wide as a crop, and its points (478, 2)."""
    noise = np.random.default_rng(0).normal(0, 1, (2 * SIZE, 2 * SIZE)).astype(np.float32)
    grain = cv2.GaussianBlur(noise, (0, 0), 2) * 12
    picture = np.full((2 * SIZE, 2 * SIZE, 3), (150, 155, 160), np.float32)
    middle = CENTRE + SIZE / 2
    place = tuple(middle.astype(int).tolist())
    cv2.ellipse(picture, place, (52, 70), 0, 0, 360, (205, 160, 135), -1)
    cv2.ellipse(picture, (place[0], place[1] + 34), (18, 5), 0, 0, 360, (150, 70, 70), -1)
    cv2.line(
        picture, (place[0] + 20, place[1] + 10), (place[0] + 32, place[1] + 40), (170, 120, 100), 2
    )
    points = np.tile(middle, (478, 1))
    angle = np.linspace(0, 2 * np.pi, len(FACE_OVAL), endpoint=False)
    points[list(FACE_OVAL)] += np.stack([52 * np.sin(angle), -70 * np.cos(angle)], 1)
    points[LEFT_EYE_OUTER] += (-EYES / 2, -20)
    points[RIGHT_EYE_OUTER] += (EYES / 2, -20)
    points[NOSE_BASE] += (0, 15)
    points[CHIN] += (0, 70)
    return np.clip(picture + grain[..., None], 0, 255), points


def film(
    draw: Draw | None, frames: int = FRAMES, moves: float = 5.0, window: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Crops (T, S, S, 3), points (T, 478, 2) and windows (T, 4) of a film with a graphic.

    Args:
        draw: onto every frame of the film. moves: px, amplitude of the head. window: px by which
            the window goes on in a frame.
    """
    picture, points = face()
    crops, all_points, windows = [], [], []
    for t in range(frames):
        way = moves * np.array([np.sin(t / 3), 0.7 * np.sin(t / 4 + 1)])
        shift = np.array([[1, 0, way[0]], [0, 1, way[1]]])
        frame = cv2.warpAffine(picture, shift, (2 * SIZE, 2 * SIZE))
        if draw is not None:
            draw(frame)
        x = SIZE // 2 + round(window * t)
        noise = np.random.default_rng(t).normal(0, 1.5, (SIZE, SIZE, 3))
        crop = frame[SIZE // 2 : SIZE // 2 + SIZE, x : x + SIZE] + noise
        crops.append(np.clip(crop, 0, 255).astype(np.uint8))
        all_points.append(points + way - (x, SIZE // 2))
        windows.append((x, SIZE // 2, SIZE, 0))
    return np.stack(crops), np.stack(all_points), np.array(windows, float)


def blended(share: float, paint: Draw) -> Draw:
    """A graphic of which so much of the film is seen."""

    def draw(frame: np.ndarray) -> None:
        painted = frame.copy()
        paint(painted)
        frame[:] = share * frame + (1 - share) * painted

    return draw


def letters(frame: np.ndarray) -> None:
    cv2.putText(frame, "MPL", (172, 252), cv2.FONT_HERSHEY_DUPLEX, 0.8, (255, 255, 255), 4)


def box(frame: np.ndarray) -> None:
    frame[240:290, 130:270] = 0


def picture(frame: np.ndarray) -> None:
    frame[205:320, 90:180] = (120, 190, 130)


def pole(frame: np.ndarray) -> None:
    frame[:, 196:210] = (70, 75, 80)


def bar(frame: np.ndarray) -> None:
    frame[236:252, 90:310] = (60, 90, 160)


def found(draw: Draw | None, shown: int = FRAMES, **how: float) -> np.ndarray:
    """Masks (T, S, S) bool of a film; the graphic is drawn in its first frames alone."""
    with_it, without = film(draw, **how), film(None, **how)  # type: ignore[arg-type]
    crops = np.concatenate([with_it[0][:shown], without[0][shown:]])
    known = np.ones(len(crops), bool)
    graphics = StillGraphics(crops, *with_it[1:], known, np.zeros(len(crops), int))
    graphics.find(lambda _: None)
    return np.stack([graphics.mask(t) for t in range(len(crops))]) > 0


def drawn(paint: Draw) -> np.ndarray:
    """Pixels (S, S) bool of a graphic in the first window."""
    black = np.zeros((2 * SIZE, 2 * SIZE, 3), np.float32) - 1
    paint(black)
    half = SIZE // 2
    return np.asarray(black[half : half + SIZE, half : half + SIZE, 0] >= 0)


def of_face() -> np.ndarray:
    """Pixels (S, S) bool of the face, well inside its outline."""
    inside = np.zeros((SIZE, SIZE), np.uint8)
    cv2.ellipse(inside, tuple(CENTRE.astype(int).tolist()), (42, 58), 0, 0, 360, 1, -1)
    return inside > 0


def test_letters_that_one_sees_through() -> None:
    masks, own = found(blended(0.6, letters)), drawn(letters)
    part = own & of_face()
    assert part.sum() > 300
    assert (masks & part).sum((1, 2)).min() > 0.8 * part.sum()
    beside = of_face() & (cv2.dilate(own.astype(np.uint8), np.ones((7, 7))) == 0)
    assert (masks & beside).sum((1, 2)).max() < 0.05 * beside.sum()


def test_a_box_as_dark_as_shade_is_masked_whole() -> None:
    masks, own = found(blended(0.5, box)), drawn(box)
    assert (masks & own).sum((1, 2)).min() > 0.95 * own.sum()
    above = of_face().copy()
    above[136:] = False  # the box begins 4 px further down
    assert not (masks & above).any()


def test_a_picture_in_a_corner_of_the_face() -> None:
    masks, own = found(picture), drawn(picture)
    assert (masks & own & of_face()).sum((1, 2)).min() > 0.95 * (own & of_face()).sum()
    beside = of_face() & (cv2.dilate(own.astype(np.uint8), np.ones((9, 9))) == 0)
    assert (masks & beside).sum((1, 2)).max() < 0.02 * beside.sum()


@pytest.mark.parametrize("draw", [pole, bar])
def test_between_the_edges_of_a_bar_and_no_further(draw: Draw) -> None:
    masks, own = found(draw), drawn(draw) & of_face()
    own[:112] = False  # the lower face
    assert (masks & own).sum((1, 2)).min() > 0.9 * own.sum()
    beside = of_face() & (cv2.dilate(drawn(draw).astype(np.uint8), np.ones((7, 7))) == 0)
    assert (masks & beside).sum((1, 2)).max() < 0.02 * beside.sum()


def test_a_graphic_ends_where_it_is_no_longer_shown() -> None:
    masks = found(blended(0.5, box), shown=30)
    assert masks[:30].any((1, 2)).all()
    assert not masks[30:].any()


def test_a_window_that_follows_the_head() -> None:
    masks, own = found(blended(0.5, box), window=0.5), drawn(box)
    for t in (0, FRAMES - 1):
        here = np.roll(own, -round(0.5 * t), 1) & of_face()
        assert (masks[t] & here).sum() > 0.9 * here.sum()


@pytest.mark.parametrize("moves", [0.0, 1.0, 5.0])
def test_a_face_alone_is_no_graphic(moves: float) -> None:
    assert not found(None, moves=moves).any()


def test_what_moves_with_the_face_is_its_own() -> None:
    painted, points = face()
    blended(0.6, letters)(painted)
    crops = []
    _, all_points, windows = film(None)
    half = SIZE // 2
    for at in all_points:
        way = at[0] - points[0] + half
        shift = np.array([[1, 0, way[0]], [0, 1, way[1]]])
        frame = cv2.warpAffine(painted, shift, (2 * SIZE, 2 * SIZE))
        crops.append(frame[half : half + SIZE, half : half + SIZE].astype(np.uint8))
    known = np.ones(FRAMES, bool)
    graphics = StillGraphics(np.stack(crops), all_points, windows, known, np.zeros(FRAMES, int))
    graphics.find(lambda _: None)
    assert not graphics.found


def test_no_face_and_few_frames() -> None:
    crops, points, windows = film(blended(0.5, box), frames=APART // 2)
    for known in (np.zeros(len(crops), bool), np.ones(len(crops), bool)):
        graphics = StillGraphics(crops, points, windows, known, np.zeros(len(crops), int))
        graphics.find(lambda _: None)
        assert not graphics.found
        assert not graphics.mask(0).any()
