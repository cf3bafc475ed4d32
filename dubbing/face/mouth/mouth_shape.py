"""The shape of the mouth, without the motion of the head.

Letters: T frames, P = 478 points of the face mesh, M mouth points.

Every frame's mesh is aligned to one canonical face by a 3-D similarity of the points that speech
does not move. Lips and chin of the aligned mesh are the mouth's shape. Lengths are in units of the
distance between the outer corners of the eyes.
"""

from collections.abc import Iterable

import numpy as np

from dubbing.face.mouth.similarity import similarity

# Clockwise from the person's right corner, lower lip first: outer edge, then inner edge.
OUTER_LIP = (
    *(61, 146, 91, 181, 84, 17, 314, 405, 321, 375),
    *(291, 409, 270, 269, 267, 0, 37, 39, 40, 185),
)
INNER_LIP = (
    *(78, 95, 88, 178, 87, 14, 317, 402, 318, 324),
    *(308, 415, 310, 311, 312, 13, 82, 81, 80, 191),
)
CHIN = (152, 148, 377, 176, 400, 199, 200, 18)
LIPS = [*OUTER_LIP, *INNER_LIP]
MOUTH = (*LIPS, *CHIN)
# Forehead, temples, corners of the eyes, bridge and sides of the nose, cheek bones.
RIGID = (
    *(10, 338, 297, 332, 284, 251, 389, 356, 454, 127, 162, 21, 54, 103, 67, 109, 234),
    *(151, 9, 8, 168, 6, 197, 195, 5, 193, 417, 122, 351, 245, 465, 188, 412),
    *(33, 133, 362, 263, 116, 345, 117, 346, 123, 352),
)
EYE_CORNERS = (33, 263)
# Pairs across the mouth opening: lower and upper edge of the inner lip.
OPENING = ((14, 13), (87, 82), (317, 312))
CORNERS = (61, 291)


def canonical_face(meshes: Iterable[np.ndarray], rounds: int = 5) -> np.ndarray:
    """Mean of the `RIGID` points after alignment, (K, 3): generalised Procrustes.

    Args:
        meshes: one (T, 478, 3) a person; every person weighs the same.
    """
    people = [m[np.isfinite(m).all((1, 2))][:, RIGID].astype(np.float64) for m in meshes]
    start = people[0].mean(0)
    face = start - start.mean(0)
    for _ in range(rounds):
        face = np.mean([similarity(points, face)(points).mean(0) for points in people], 0)
        face -= face.mean(0)
        corners = [RIGID.index(p) for p in EYE_CORNERS]
        face /= np.linalg.norm(face[corners[0]] - face[corners[1]])
    return face.astype(np.float32)


def mouth_shape(meshes: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Lips and chin on the canonical face, (T, M, 2) float32: right and down in eye distances.

    Args:
        meshes: (T, 478, 3) pixels; NaN where no face was found, NaN in the result.
        face: the canonical `RIGID` points (K, 3).
    """
    shapes = np.full((len(meshes), len(MOUTH), 2), np.nan, np.float32)
    valid = np.isfinite(meshes).all((1, 2))
    if valid.any():
        points = meshes[valid].astype(np.float64)
        aligned = similarity(points[:, RIGID], face.astype(np.float64))
        shapes[valid] = aligned(points[:, MOUTH])[:, :, :2]
    return shapes


def opening(shapes: np.ndarray) -> np.ndarray:
    """Height of the mouth opening (T,) of `mouth_shape`, in eye distances."""
    low = [MOUTH.index(a) for a, _ in OPENING]
    high = [MOUTH.index(b) for _, b in OPENING]
    return np.linalg.norm(shapes[:, low] - shapes[:, high], axis=2).mean(1)


def width(shapes: np.ndarray) -> np.ndarray:
    """Width of the mouth (T,) of `mouth_shape`, in eye distances."""
    right, left = (MOUTH.index(p) for p in CORNERS)
    return np.linalg.norm(shapes[:, right] - shapes[:, left], axis=1)
