"""The mean head shape and its frame."""

import numpy as np
import pytest

from dubbing.face import mesh_points as points
from dubbing.preparation.alignment.camera import rotation_from_vector
from dubbing.preparation.tracking.procrustes import head_frame, mean_shape


@pytest.fixture
def shape() -> np.ndarray:
    rng = np.random.default_rng(0)
    out = rng.normal(0, 0.3, (points.LANDMARKS, 3))
    out[points.LEFT_EYE_OUTER], out[points.RIGHT_EYE_OUTER] = (
        [-0.45, -0.3, -0.6],
        [0.45, -0.3, -0.6],
    )
    out[points.LEFT_EAR], out[points.RIGHT_EAR] = [-0.7, 0, 0], [0.7, 0, 0]
    out[points.FOREHEAD_TOP], out[points.CHIN] = [0, -0.8, -0.5], [0, 0.9, -0.5]
    return out


def test_mean_of_moved_copies_is_the_shape(shape: np.ndarray) -> None:
    rng = np.random.default_rng(1)
    turns = rotation_from_vector(rng.normal(0, 0.3, (20, 3)))
    copies = np.stack([rng.uniform(80, 120) * shape @ t.T + rng.normal(0, 50, 3) for t in turns])
    copies += rng.normal(0, 0.5, copies.shape)
    mean = head_frame(mean_shape(copies, points.RIGID))
    np.testing.assert_allclose(mean, shape, atol=0.02)


def test_head_frame_has_the_agreed_axes_and_scale(shape: np.ndarray) -> None:
    turn = rotation_from_vector(np.array([[0.2, 0.4, -0.3]]))[0]
    placed = head_frame(150 * shape @ turn.T + [300, 200, 50])
    eyes = placed[[points.LEFT_EYE_OUTER, points.RIGHT_EYE_OUTER]]
    assert eyes[1] - eyes[0] == pytest.approx([0.9, 0, 0], abs=1e-9)
    assert placed[[points.LEFT_EAR, points.RIGHT_EAR]].mean(0) == pytest.approx([0, 0, 0], abs=1e-9)
    down = placed[points.CHIN] - placed[points.FOREHEAD_TOP]
    assert down[1] > 1.6
    assert down[2] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(placed, shape, atol=1e-9)


def test_rigid_points_are_distinct_and_not_of_mouth_jaw_or_lids() -> None:
    assert len(set(points.RIGID)) == len(points.RIGID) >= 80
    lips = {13, 14, 61, 291, 0, 17, 37, 267, 84, 314}
    lids = {159, 145, 386, 374}
    brows = {70, 63, 105, 66, 107, 300, 293, 334, 296, 336}
    assert not set(points.RIGID) & (set(points.JAW) | lips | lids | brows)
