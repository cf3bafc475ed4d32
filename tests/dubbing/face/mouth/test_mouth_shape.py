"""The mouth's shape: what the head does must not matter, what the mouth does must."""

import numpy as np

from dubbing.face.mouth import mouth_shape as mouth
from dubbing.face.mouth.similarity import similarity
from tests.dubbing.sync.meshes import canonical, made_mesh, talk, turned

OPENING = np.array([0.0, 0.1, 0.2, 0.05])


def test_pose_does_not_matter() -> None:
    still = mouth.mouth_shape(talk(OPENING), canonical())
    moved = mouth.mouth_shape(turned(talk(OPENING), 0.5, 140.0, (300, 200)), canonical())
    assert still.shape == (4, len(mouth.MOUTH), 2)
    assert np.allclose(still, moved, atol=1e-4)


def test_opening_and_width() -> None:
    shapes = mouth.mouth_shape(talk(OPENING, 0.44), canonical())
    # Three pairs of points on an ellipse: at its middle and 36 degrees beside it.
    expected = OPENING * (1 + 2 * np.sin(np.radians(72 - 18))) / 3
    measured = mouth.opening(shapes)
    assert measured[0] < 1e-5
    assert np.all(np.abs(np.diff(measured / np.maximum(OPENING, 1e-3))[1:]) < 1e-3)
    assert np.allclose(measured, expected, rtol=0.15, atol=1e-5)
    assert np.allclose(mouth.width(shapes), 0.44, atol=1e-4)


def test_missing_faces_stay_missing() -> None:
    meshes = talk(OPENING)
    meshes[2] = np.nan
    shapes = mouth.mouth_shape(meshes, canonical())
    assert np.isnan(shapes[2]).all()
    assert np.isfinite(shapes[[0, 1, 3]]).all()


def test_canonical_face_of_several_people() -> None:
    rng = np.random.default_rng(2)
    people = [
        turned(talk(OPENING), yaw, scale, (scale, 2 * scale)) + rng.normal(0, 0.01, (4, 478, 3))
        for yaw, scale in ((0.0, 90.0), (0.3, 200.0), (-0.3, 150.0))
    ]
    face = mouth.canonical_face(people)
    corners = [mouth.RIGID.index(p) for p in mouth.EYE_CORNERS]
    assert np.isclose(np.linalg.norm(face[corners[0]] - face[corners[1]]), 1)
    (laid,) = similarity(face[None], canonical())(face[None])
    assert np.abs(laid - made_mesh()[list(mouth.RIGID)]).max() < 1e-3
