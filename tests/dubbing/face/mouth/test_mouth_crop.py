"""Crops of the mouth stay where they are on the face, whatever the head does."""

import numpy as np

from dubbing.face.mouth.mouth_crop import COLUMNS, MIDDLE, PITCH, ROWS, mouth_crop, mouth_crops
from tests.dubbing.sync.meshes import canonical, made_mesh, turned

FACE = canonical()


def painted(scale: float, shift: tuple[float, float], size: int = 400) -> np.ndarray:
    """A picture of waves that lie on the face of a mesh with this scale and place."""
    row, column = np.mgrid[:size, :size]
    # Pixel k is seen at k; the mesh's units are eye distances.
    across, down = (column - shift[0]) / scale, (row - shift[1]) / scale
    waves = np.sin(9 * across) + np.cos(7 * down + 4 * across)
    return np.repeat(np.round(128 + 50 * waves).astype(np.uint8)[..., None], 3, 2)


def test_size_and_place_of_the_head_do_not_matter() -> None:
    crops = []
    for scale, shift in ((80.0, (200.0, 150.0)), (170.0, (180.0, 90.0)), (50.0, (90.0, 260.0))):
        points = turned(made_mesh()[None], 0, scale, shift)[0]
        crops.append(mouth_crop(painted(scale, shift), points, FACE).astype(int))
    assert crops[0].shape == (ROWS, COLUMNS)
    assert crops[0].std() > 20
    for other in crops[1:]:
        assert np.abs(other - crops[0]).mean() < 2


def test_the_rectangle_is_where_it_is_said_to_be() -> None:
    scale, shift = 100.0, (200.0, 150.0)
    frame = np.zeros((400, 400, 3), np.uint8)
    column, row = (MIDDLE[:2] + np.array([0.2, -0.1])) * scale + np.array(shift)
    frame[round(row) - 2 : round(row) + 3, round(column) - 2 : round(column) + 3] = 255
    points = turned(made_mesh()[None], 0, scale, shift)[0]
    crop = mouth_crop(frame, points, FACE).astype(float)
    place = np.array([(crop.sum(0) @ np.arange(COLUMNS)), (crop.sum(1) @ np.arange(ROWS))])
    expected = np.array([0.2, -0.1]) / PITCH + (np.array([COLUMNS, ROWS]) - 1) / 2
    assert np.allclose(place / crop.sum(), expected, atol=0.5)


def test_a_finer_picture_does_not_alias() -> None:
    row, column = np.mgrid[:1000, :1000]
    frame = np.repeat(((row + column) % 2 * 255).astype(np.uint8)[..., None], 3, 2)
    points = turned(made_mesh()[None], 0, 400.0, (480.0, 200.0))[0]
    assert mouth_crop(frame, points, FACE).std() < 12


def test_a_mouth_at_the_edge_of_the_picture() -> None:
    points = turned(made_mesh()[None], 0, 100.0, (-30.0, 380.0))[0]
    frame = np.full((400, 400, 3), 90, np.uint8)
    assert (mouth_crop(frame, points, FACE) == 90).all()


def test_frames_without_a_face_have_no_crop() -> None:
    meshes = np.repeat(turned(made_mesh()[None], 0, 100.0, (200.0, 150.0)), 3, 0)
    meshes[1] = np.nan
    crops = mouth_crops(np.full((3, 400, 400, 3), 77, np.uint8), meshes, FACE)
    assert [set(np.unique(c)) for c in crops] == [{77}, {0}, {77}]
