"""The line along which a head is cut from its neck.

T frames, S the side of the crop in px.
"""

import numpy as np

from dubbing.face.face_contour import evenly, face_contour
from dubbing.face.mesh_points import CHIN, FOREHEAD_TOP, JAW
from dubbing.preparation.alignment.bundle import Observations
from dubbing.preparation.alignment.camera import Poses, project, to_camera

OUTLINE_POINTS = 96
# From the ends of the jaw line to below the ear lobes, in units of 10 cm: out, down and back.
LOBES = np.array([[-0.12, 0.1, 0.45], [0.12, 0.1, 0.45]])


def jaw_outline(
    landmarks: np.ndarray, shape: np.ndarray, poses: Poses, observed: Observations, size: int
) -> np.ndarray:
    """Line (T, K, 2) px from left to right along which the head is cut from the neck.

    It is the lower part of the face's contour. At both ends a point under the ear lobe is added,
    which FaceMesh does not have: it comes from the shape and the pose, so that it moves correctly
    when the head nods. A lobe that the face hides is left out.
    """
    ends = shape[[JAW[0], JAW[-1]]]
    lobes = project(to_camera(poses, ends + LOBES), observed.focal, observed.centre)
    return np.stack([cut_line(*pair, size) for pair in zip(landmarks, lobes, strict=True)])


def cut_line(landmarks: np.ndarray, lobes: np.ndarray, size: int) -> np.ndarray:
    """The line (OUTLINE_POINTS, 2) px of one frame; lobes (2, 2) px, the left one first.

    The far lobe of a profile may lie beside the face, behind the near one.
    """
    contour = face_contour(landmarks, size)
    jaw = contour.jaw()
    up = landmarks[FOREHEAD_TOP] - landmarks[CHIN]
    beyond = (lobes - jaw[[0, -1]]) @ [-up[1], up[0]] * [-1, 1] > 0
    left, right = (
        [lobe] if seen and not contour.holds(lobe) else []
        for lobe, seen in zip(lobes, beyond, strict=True)
    )
    return evenly(np.stack([*left, *jaw, *right]), OUTLINE_POINTS)
