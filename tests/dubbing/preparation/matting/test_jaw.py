"""The edge of the jaw on made pictures: found where it is, left alone where there is none."""

import numpy as np

from dubbing.face.mesh_points import LEFT_EAR, NOSE_TIP, RIGHT_EAR
from dubbing.preparation.matting.jaw import (
    OPEN_PROFILE,
    POINTS,
    PROFILE,
    edge_costs,
    edge_offsets,
    moved,
    smooth_offsets,
    smoothest,
    steps,
    turned_share,
)

SIZE = 512


def jaw_row(column: np.ndarray) -> np.ndarray:
    """Rows of the jaw at columns."""
    return np.asarray(300 + 80 * np.sin(np.clip((column - 120) / 272, 0, 1) * np.pi))


LINE = np.stack((np.linspace(120, 392, 17), jaw_row(np.linspace(120, 392, 17))), 1)
MIDDLE = slice(POINTS // 4, 3 * POINTS // 4)


def picture(below: float, collar: int | None = None) -> np.ndarray:
    """Skin down to so many px below the line, then darker neck, then a white collar at a row."""
    row, column = np.mgrid[:SIZE, :SIZE].astype(float)
    edge = jaw_row(column) + below
    image = np.full((SIZE, SIZE, 3), 190, np.uint8)
    image[row > edge] = 130
    if collar is not None:
        image[row > collar] = 255
    return image


def offsets_in(image: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Offsets (POINTS,) px of the edge in one picture."""
    return offsets_of(image, np.full(image.shape[:2], 255, np.uint8), line)


def offsets_of(image: np.ndarray, person: np.ndarray, line: np.ndarray) -> np.ndarray:
    """The same with a mask of the person (S, S) uint8."""
    return edge_offsets(edge_costs(image, person, line)[None], len(image))[0]


def test_the_edge_is_found_where_it_is() -> None:
    for below in (0.0, 3.0, 6.0, 15.0):
        offset = offsets_in(picture(below), LINE)
        line = moved(LINE, offset)[MIDDLE]
        truth = jaw_row(line[:, 0]) + below
        assert np.abs(line[:, 1] - truth).max() < 1.6


def test_a_chin_before_the_wall_ends_where_the_person_does() -> None:
    """As in a profile: nothing but the mask tells the chin from a wall of its colour."""
    image = np.full((SIZE, SIZE, 3), 190, np.uint8)
    row, column = np.mgrid[:SIZE, :SIZE].astype(float)
    edge = jaw_row(column) + 18
    chin = np.where((row < edge) | (column < 200), 255, 0).astype(np.uint8)  # and a neck
    line = moved(LINE, offsets_of(image, chin, LINE))
    there = line[(line[:, 0] > 240) & (line[:, 0] < 330)]
    truth = jaw_row(there[:, 0]) + 18
    assert np.abs(there[:, 1] - truth).max() < 2.5
    neck = offsets_of(image, chin, LINE)[: POINTS // 5]
    assert np.abs(neck).max() < 2.5


def test_an_open_chin_lies_behind_the_line_and_far_below_it() -> None:
    """The chin of the line, its lowest point, is in the wall; that of the picture 38 px lower."""
    row, column = np.mgrid[:SIZE, :SIZE]
    below = np.clip(row - jaw_row(column), 0, 38)
    image = np.repeat((190 - 3 * below)[..., None], 3, 2).astype(np.uint8)
    person = np.where((row < jaw_row(column) + 38) & (column < 250), 255, 0).astype(np.uint8)
    costs = edge_costs(image, person, LINE, 0.8, None, OPEN_PROFILE)
    line = moved(LINE, edge_offsets(costs[None], SIZE)[0])
    chin = (line[:, 0] > 180) & (line[:, 0] < 235)
    assert chin.sum() > 5
    assert np.abs(line[chin, 1] - jaw_row(line[chin, 0]) - 38).max() < 8


def test_the_shading_of_a_profile_is_no_edge_but_that_of_a_neck_is() -> None:
    row, column = np.mgrid[:SIZE, :SIZE].astype(float)
    line = jaw_row(column)
    shade = np.clip(190 - 5 * np.maximum(row - line, 0), 90, None)
    image = np.repeat(shade[..., None], 3, 2).astype(np.uint8)
    middle = slice(POINTS // 2 - 5, POINTS // 2 + 5)
    chin = np.where(row < line + 20, 255, 0).astype(np.uint8)
    assert np.abs(offsets_of(image, chin, LINE)[middle] - 20).max() < 2.5
    neck = np.where((row < line + 20) | (np.abs(column - 256) < 40), 255, 0).astype(np.uint8)
    assert offsets_of(image, neck, LINE)[middle].max() < 12


def test_a_collar_further_down_is_no_chin() -> None:
    chin = offsets_in(picture(1.0), LINE)[POINTS // 2 - 5 : POINTS // 2 + 5]
    with_collar = offsets_in(picture(1.0, collar=400), LINE)[POINTS // 2 - 5 : POINTS // 2 + 5]
    assert np.abs(with_collar - chin).max() <= 1


def test_without_an_edge_the_line_stays() -> None:
    plain = np.full((SIZE, SIZE, 3), 150, np.uint8)
    assert np.abs(offsets_in(plain, LINE)).max() == 0


def test_lengths_grow_with_the_picture() -> None:
    small = offsets_in(picture(6.0)[::2, ::2], LINE / 2)
    assert abs(np.median(small[MIDDLE]) - np.median(offsets_in(picture(6.0), LINE)[MIDDLE]) / 2) < 1


def test_the_path_of_least_cost_is_the_best_of_all() -> None:
    rng = np.random.default_rng(0)
    costs, bend = rng.random((3, 5, 4)), np.array([0.3, 0.0, 0.3])

    def price(path: tuple[int, ...], cost: np.ndarray) -> float:
        steps = np.abs(np.diff(path))
        return np.inf if steps.max() > 1 else cost[range(5), path].sum() + bend[1 + steps].sum()

    for cost, found in zip(costs, smoothest(costs, bend), strict=True):
        best = min(np.ndindex(4, 4, 4, 4, 4), key=lambda path: price(path, cost))
        assert tuple(found) == best


def test_a_step_is_the_difference_of_means_on_both_sides() -> None:
    profile = np.repeat([10.0, 30.0], 8)[None, :, None]
    found = steps(profile, 3)[0, :, 0]
    assert found[7] == found[8] or abs(found).argmax() in (7, 8)
    assert found[3] == 0
    np.testing.assert_allclose(found[8], (30 * 3 - 10 * 3) / 3)


def test_the_jaw_line_of_a_turned_head_says_less() -> None:
    """Beyond 25 degrees it is that of a mean face: the edge may lie further down."""
    image, person = picture(24), np.full((SIZE, SIZE), 255, np.uint8)
    image[image == 130] = 165  # a weak edge, above skin that grows darker
    row = np.arange(SIZE)[:, None, None]
    image = np.clip(image - 0.12 * np.maximum(row - 300, 0), 0, 255).astype(np.uint8)
    frontal, turned = (edge_costs(image, person, LINE, unsure)[None] for unsure in (0, 0.8))
    middle = slice(POINTS // 2 - 5, POINTS // 2 + 5)
    assert edge_offsets(frontal, SIZE)[0, middle].max() < 12
    assert np.abs(edge_offsets(turned, SIZE)[0, middle] - 24).max() < 3


def test_how_far_a_head_is_turned_shows_between_its_ears() -> None:
    points = np.zeros((478, 2))
    points[[LEFT_EAR, RIGHT_EAR]] = (100, 200), (300, 220)
    shares = []
    for place in (0.5, 0.4, 0.8, 0.95, 2.5):
        points[NOSE_TIP] = (100 + 200 * place, 260)
        shares.append(turned_share(points))
    assert shares[:2] == [0, 0]
    assert 0 < shares[2] < shares[3] == shares[4] == 1
    assert turned_share(points, PROFILE) == 1
    points[NOSE_TIP] = (280, 260)
    assert turned_share(points, PROFILE) == 0


def test_offsets_are_smooth_in_time_but_not_across_a_cut() -> None:
    offsets = np.zeros((40, POINTS))
    offsets[10] = 12  # one wrong frame
    offsets[20:] = 8
    smooth = smooth_offsets(offsets, np.repeat([0, 1], 20))
    assert smooth[:20].max() < 0.01
    assert smooth[20:].min() > 7.99
