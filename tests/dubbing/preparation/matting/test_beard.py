"""A beard on made pictures: told from a shaven chin in the shade, and cut where it ends."""

from dataclasses import replace

import numpy as np
import pytest

from dubbing.face.face_contour import evenly
from dubbing.face.mesh_points import SKIN
from dubbing.preparation.matting.beard import Beard, JawColours, jaw_colours
from dubbing.preparation.matting.jaw import (
    POINTS,
    edge_costs,
    edge_offsets,
    expect_as_around,
    moved,
    normals,
)
from tests.dubbing.preparation.matting.test_jaw import LINE, SIZE, jaw_row

MIDDLE = slice(POINTS // 3, 2 * POINTS // 3)
SKIN_COLOUR, BEARD, SHIRT = (205, 160, 135), (60, 45, 35), (40, 60, 110)
PERSON = np.full((SIZE, SIZE), 255, np.uint8)


def landmarks() -> np.ndarray:
    """Points of a face whose nose and cheeks are at a bare place, (478, 2) px."""
    points = np.zeros((478, 2))
    points[list(SKIN)] = (256, 200)
    return points


def picture(length: float, shade: float = 1.0, seed: int = 0) -> np.ndarray:
    """A beard so many px below the jaw line, hairs of many lengths; a neck in the shade; a shirt.

    Args:
        length: of the beard; 0: there is none.
    """
    row, column = np.mgrid[:SIZE, :SIZE].astype(float)
    line = jaw_row(column)
    rng = np.random.default_rng(seed)
    image = np.empty((SIZE, SIZE, 3))
    image[:] = SKIN_COLOUR
    image[row > line] *= shade
    image[row > 480] = SHIRT
    if length:
        hairs = np.repeat(rng.normal(0, 3, SIZE // 4), 4)
        beard = (row > line - 40) & (row < line + length + hairs)
        tone = np.repeat(rng.uniform(0.5, 1.5, (SIZE // 8, SIZE)), 8, axis=0)
        image[beard] = np.array(BEARD) * tone[beard][:, None]
    return image.clip(0, 255).astype(np.uint8)


def colours(image: np.ndarray) -> JawColours:
    line = evenly(LINE, POINTS)
    return jaw_colours(image, landmarks(), line, normals(line))


def offsets(image: np.ndarray) -> np.ndarray:
    """Offsets (POINTS,) px of the edge in one picture, as in a shot that shows nothing else."""
    found = colours(image)
    beard = Beard.of([found])
    costs = edge_costs(image, PERSON, LINE, beard.share, found.usual(beard))[None]
    return edge_offsets(expect_as_around(costs, np.array([beard.share])), SIZE)[0]


@pytest.mark.parametrize("length", [20, 45, 65])
@pytest.mark.parametrize("shade", [1.0, 0.55])
def test_the_edge_lies_where_the_beard_ends(length: int, shade: float) -> None:
    line = moved(LINE, offsets(picture(length, shade)))[MIDDLE]
    truth = jaw_row(line[:, 0]) + length
    assert np.abs(line[:, 1] - truth).max() < 6


@pytest.mark.parametrize("shade", [1.0, 0.8, 0.55])
def test_a_neck_in_the_shade_is_no_beard(shade: float) -> None:
    assert Beard.of([colours(picture(0, shade))]).share == 0


def test_a_beard_is_told_by_most_frames_of_a_shot() -> None:
    shaven, bearded = colours(picture(0)), colours(picture(40))
    assert Beard.of([shaven, bearded, bearded]).share == 1
    assert Beard.of([shaven, shaven, bearded]).share == 0


@pytest.mark.parametrize("below", [SHIRT, (235, 230, 232), SKIN_COLOUR])
def test_below_the_edge_hairs_are_the_heads_and_what_is_between_them_is_not(
    below: tuple[int, int, int],
) -> None:
    image = picture(40)
    image[-40:] = below
    image[-40:, ::4] = BEARD
    like = colours(image).like_hairs(image)[-40:]
    assert like[:, ::4].mean() > 0.9
    assert like[:, 2::4].mean() < 0.1


def test_beside_a_goatee_the_jaw_stays_where_it_is() -> None:
    image, shaven = picture(45), picture(0)
    image[:, :190], image[:, 320:] = shaven[:, :190], shaven[:, 320:]
    found = offsets(image)
    assert np.abs(found[10:20]).max() < 4
    assert found[POINTS // 2] > 30


def test_where_the_line_lies_on_bare_skin_the_beard_is_that_of_the_shot() -> None:
    """As FaceMesh's line does where a head looks down."""
    usual = Beard.of([colours(picture(20, seed=seed)) for seed in range(3)])
    image, bare = picture(50), picture(0)
    row, column = np.mgrid[:SIZE, :SIZE].astype(float)
    chin = row < jaw_row(column) + 10
    image[chin] = bare[chin]
    found = [
        edge_offsets(edge_costs(image, PERSON, LINE, 1, each)[None], SIZE)[0, MIDDLE]
        for each in (replace(colours(image), share=1), colours(image).usual(usual))
    ]
    assert (found[0] < 30).all()
    assert np.abs(found[1] - 50).max() < 8


@pytest.mark.parametrize("frames", [3, 5, 7])  # much fewer than those it looks at, if it could
def test_a_frame_that_shows_no_edge_takes_the_length_of_the_others(frames: int) -> None:
    """As where a beard hangs over a shirt of its colour."""
    images = [picture(45, seed=seed) for seed in range(frames)]
    row, column = np.mgrid[:SIZE, :SIZE].astype(float)
    line = jaw_row(column)
    images[-1][row > line + 30] = BEARD
    found = [colours(image) for image in images]
    beard = Beard.of(found)
    assert beard.share == 1
    pairs = [(image, each.usual(beard)) for image, each in zip(images, found, strict=True)]
    costs = np.stack([edge_costs(image, PERSON, LINE, 1, each) for image, each in pairs])

    def too_long(costs: np.ndarray) -> float:
        lengths = edge_offsets(costs, SIZE)[:, MIDDLE]
        return float((lengths[-1] - lengths[0]).max())

    assert too_long(costs) > 20
    assert too_long(expect_as_around(costs, np.ones(frames))) < 16
