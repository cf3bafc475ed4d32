import numpy as np
from scipy.spatial.transform import Rotation

from dubbing.face.mouth.similarity import similarity


def test_every_similarity_is_recovered() -> None:
    target = np.random.default_rng(0).normal(size=(9, 3))
    turns = Rotation.from_rotvec([[0.3, -0.5, 0.2], [0.0, 0.4, 0.0]]).as_matrix()
    scales, shifts = np.array([2.5, 37.0]), np.array([[1.0, 2.0, 3.0], [5.0, -3.0, 0.0]])
    points = scales[:, None, None] * target @ turns.transpose(0, 2, 1) + shifts[:, None]
    fit = similarity(points, target)
    np.testing.assert_allclose(fit.scale, 1 / scales)
    np.testing.assert_allclose(fit.rotation, turns.transpose(0, 2, 1), atol=1e-12)
    np.testing.assert_allclose(fit(points), [target, target], atol=1e-12)
    # The definition: scale * rotation @ x + translation.
    one = fit.scale[1] * fit.rotation[1] @ points[1, 4] + fit.translation[1]
    np.testing.assert_allclose(one, target[4], atol=1e-12)


def test_a_mirrored_face_is_turned_not_mirrored() -> None:
    target = np.random.default_rng(1).normal(size=(9, 3))
    fit = similarity((target * [-1, 1, 1])[None], target)
    np.testing.assert_allclose(np.linalg.det(fit.rotation), 1)
