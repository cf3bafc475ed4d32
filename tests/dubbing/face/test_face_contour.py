"""The contour of a face: the oval from the front, cheek and nose where the head is turned."""

from functools import cache

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.face.face_contour import evenly, face_contour, face_region
from dubbing.face.finding.landmarks import FaceMesh
from dubbing.face.mesh_points import CHIN, FACE_OVAL, JAW
from dubbing.face.mesh_triangles import TRIANGLES
from dubbing.workshop.synthetic.anatomy.face import face_by_name
from dubbing.workshop.synthetic.rendering.camera import FLIP, UNIT, Pose
from dubbing.workshop.synthetic.rendering.render import REST_SHIFT, Renderer, State

pytestmark = pytest.mark.medium
S = 256


@cache
def shape() -> np.ndarray:
    """FaceMesh (478, 3) of the synthetic speaker from the front, its middle at 0, px."""
    renderer = Renderer(face_by_name("alba"), S)
    at_rest = State(Pose(np.eye(3), FLIP @ REST_SHIFT / UNIT))
    (mesh,) = FaceMesh(tracking=False)(renderer.render(at_rest).image)
    return np.asarray(mesh - mesh.mean(0))


def seen(yaw: float) -> np.ndarray:
    """Landmarks (478, 2) px of that face, turned."""
    turned = shape() @ Rotation.from_euler("Y", yaw, degrees=True).as_matrix().T
    return np.asarray(S / 2 + 1.6 * turned[:, :2])


def test_from_the_front_it_is_the_oval() -> None:
    points = seen(0)
    oval = np.zeros((S, S), np.uint8)
    cv2.fillPoly(oval, [points[list(FACE_OVAL)].round().astype(np.int32)], 255)
    region = face_region(points, S)
    both, either = ((region > 0) & (oval > 0)).sum(), ((region > 0) | (oval > 0)).sum()
    assert both > 0.97 * either
    jaw = face_contour(points, S).jaw()
    for mark in points[list(JAW[2:-2])]:
        assert np.linalg.norm(jaw - mark, axis=1).min() < 2
    assert jaw[0, 0] < points[CHIN, 0] < jaw[-1, 0]


@pytest.mark.parametrize("yaw", [30, 50, 70, -30, -50, -70])
def test_a_turned_head_keeps_its_far_side(yaw: float) -> None:
    points = seen(yaw)
    contour = face_contour(points, S)
    assert contour.points[:, 0].min() == pytest.approx(points[:468, 0].min(), abs=2)
    assert contour.points[:, 0].max() == pytest.approx(points[:468, 0].max(), abs=2)
    far = -1 if yaw > 0 else 1
    jaw = contour.jaw()
    ends = jaw[0, 0] if far < 0 else -jaw[-1, 0]
    hidden = points[JAW[1] if far < 0 else JAW[-2], 0] * (1 if far < 0 else -1)
    # The jaw line of the mesh runs inside of the face there: the contour lies beyond it.
    assert ends <= hidden + 1


def test_heights_tell_the_jaw_from_the_cheek_whichever_way_a_head_is_turned() -> None:
    for yaw in (0, 40, -60):
        contour = face_contour(seen(yaw), S)
        shares = contour.jaw_shares()
        assert shares[contour.heights.argmin()] == 1
        assert (shares[contour.heights > contour.cheeks.mean() + 0.02] == 0).all()


def test_a_face_outside_of_the_image_has_a_contour() -> None:
    for shift in (-200, 300, 5000):
        assert len(face_contour(seen(20) + shift, S).points) > 3


def test_points_lie_evenly_on_a_line() -> None:
    line = evenly(np.array([[0.0, 0], [3, 0], [3, 4]]), 8)
    np.testing.assert_allclose(np.linalg.norm(np.diff(line, axis=0), axis=1), 1)


def test_triangles_cover_every_point_once() -> None:
    found = TRIANGLES
    assert set(found.ravel()) == set(range(468))
    edges = np.sort(np.concatenate([found[:, [0, 1]], found[:, [1, 2]], found[:, [2, 0]]]), 1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert set(uses) == {1, 2}
    assert (uses == 1).sum() == len(FACE_OVAL)
