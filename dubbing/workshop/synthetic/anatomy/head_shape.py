"""The shape of the head as a signed distance field, in centimetres.

Head frame of this package: x right in the image, y up, z towards the viewer, origin between
the ears. The field is a smooth union of ellipsoids and capsules (polynomial smooth minimum,
after Quilez), symmetric in x. Ellipsoid distances are first order estimates, so a ray marcher
has to shorten its steps.
"""

from collections.abc import Callable

import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face

EYE = np.array([3.15, 3.0, 6.85])  # centre of the eye at +x; the other is its mirror image
EYE_RADIUS = 1.32
LID = EYE_RADIUS + 0.10  # cm
EYE_HALF_WIDTH = 1.35  # outer corners at x = +-4.5: 0.9 in units of 10 cm
MOUTH_Y = -4.2
MOUTH_HALF_WIDTH = 2.55


def ellipsoid(p: np.ndarray, centre: tuple[float, ...], radii: tuple[float, ...]) -> np.ndarray:
    """Distance estimate to an axis-aligned ellipsoid at points p (3, N), (N,)."""
    x, y, z = ((p[k] - centre[k]) / radii[k] for k in range(3))
    k0 = np.sqrt(x * x + y * y + z * z)
    k1 = np.sqrt((x / radii[0]) ** 2 + (y / radii[1]) ** 2 + (z / radii[2]) ** 2)
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def capsule(
    p: np.ndarray, a: tuple[float, ...], b: tuple[float, ...], ra: float, rb: float
) -> np.ndarray:
    """Distance of points p (3, N) to a round cone from a to b with radii ra to rb, (N,)."""
    ax, ay, az = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    x, y, z = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    h = np.clip((x * ax + y * ay + z * az) / (ax * ax + ay * ay + az * az), 0.0, 1.0)
    x, y, z = x - h * ax, y - h * ay, z - h * az
    return np.sqrt(x * x + y * y + z * z) - (ra + (rb - ra) * h)


def smooth_min(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    """Polynomial smooth minimum: union of two fields with a fillet of about k centimetres."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * k * 0.25


def smooth_cut(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    """Field a without the inside of field b, with a rounded edge."""
    return -smooth_min(-a, b, k)


def head_distance(p: np.ndarray, face: Face) -> np.ndarray:
    """Signed distance of points p (N, 3) to the bald head without ears and neck, (N,)."""
    p = np.stack([np.abs(p[:, 0]), p[:, 1], p[:, 2]]).astype(np.float32)
    jaw, chin = face.jaw_width, face.chin_length
    d = ellipsoid(p, (0, 4.5, -1.0), (7.35, 8.5, 9.2))
    d = smooth_min(d, ellipsoid(p, (0, 6.2, 3.2), (5.7, 4.6, 5.1)), 1.5)  # forehead
    d = smooth_min(d, ellipsoid(p, (0, -0.6, 2.4), (6.1, 6.6, 6.2)), 1.6)  # mid-face
    d = smooth_min(d, ellipsoid(p, (0, -4.0 * chin, 2.9), (4.7 * jaw, 4.7, 5.5)), 2.0)
    corner = (4.35 * jaw, -4.9 * chin, 1.2)
    d = smooth_min(d, capsule(p, (5.3, -0.4, -0.2), corner, 0.9, 0.95), 2.2)
    d = smooth_min(d, capsule(p, corner, (1.3, -7.9 * chin, 6.9), 0.95, 1.0), 2.2)
    d = smooth_min(d, ellipsoid(p, (0, -7.75 * chin, 7.35), (1.75, 1.35, 1.65)), 1.8)  # chin
    bone = face.cheekbones
    d = smooth_min(d, ellipsoid(p, (4.2, 0.3, 5.5), (1.6, 1.3 * bone, 1.85 * bone)), 2.6)
    d = smooth_min(d, ellipsoid(p, (3.3, -1.8, 6.2), (1.7, 1.9, 1.8)), 1.5)  # cheeks
    d = smooth_min(d, ellipsoid(p, (0, -4.1, 6.5), (3.3, 2.8, 3.0)), 1.4)  # muzzle
    d = smooth_min(d, capsule(p, (0.9, 4.35, 8.05), (4.1, 4.75, 6.6), 0.70, 0.6), 1.9)  # brow
    socket = ellipsoid(p, (3.0, 3.0, 9.3), (1.95, 1.25, 1.45))
    d = smooth_cut(d, socket, 1.4)
    lid = capsule(p, (EYE[0], EYE[1], EYE[2]), (EYE[0] + 0.01, EYE[1], EYE[2]), LID, LID)
    d = smooth_min(d, lid, 0.35)
    return _lips(_nose(d, p, face), p, face)


def outward(
    distance: Callable[[np.ndarray], np.ndarray], p: np.ndarray, reach: float
) -> np.ndarray:
    """Unit gradient (N, 3) of a distance field at points p (N, 3): differences over 2 reach cm."""
    steps = reach * np.eye(3)
    slope = np.stack([distance(p + step) - distance(p - step) for step in steps], axis=-1)
    return slope / np.maximum(np.linalg.norm(slope, axis=-1, keepdims=True), 1e-9)


def _nose(d: np.ndarray, p: np.ndarray, face: Face) -> np.ndarray:
    length, width = face.nose_length, face.nose_width
    tip_y, tip_z = -0.55 * length, 10.55 + 0.75 * (length - 1.0) * 4
    d = smooth_min(d, capsule(p, (0, 3.7, 8.0), (0, tip_y + 0.5, tip_z - 0.2), 0.5, 0.72), 0.9)
    d = smooth_min(d, ellipsoid(p, (0, tip_y, tip_z), (0.92 * width, 0.82, 0.95)), 0.6)
    d = smooth_min(
        d, ellipsoid(p, (1.05 * width, tip_y - 0.40, 9.45), (0.60 * width, 0.60, 0.95)), 0.55
    )
    d = smooth_min(d, capsule(p, (0, tip_y - 0.5, tip_z), (0, tip_y - 1.15, 9.2), 0.36, 0.4), 0.35)
    hole = ellipsoid(p, (0.55 * width, tip_y - 1.05, tip_z - 0.65), (0.30 * width, 0.42, 0.52))
    return smooth_cut(d, hole, 0.2)


def _lips(d: np.ndarray, p: np.ndarray, face: Face) -> np.ndarray:
    full, half = face.lip_fullness, MOUTH_HALF_WIDTH * face.mouth_width
    up, low = 0.34 * full, 0.44 * full
    corner = (half - 0.25, MOUTH_Y, 8.15)
    mid = (1.15, MOUTH_Y + 0.30 * full, 9.22)
    upper = smooth_min(
        capsule(p, (0.0, MOUTH_Y + 0.27 * full, 9.45), mid, up * 0.9, up),
        capsule(p, mid, corner, up, 0.10),
        0.25,
    )
    mid = (1.05, MOUTH_Y - 0.40 * full, 9.05)
    lower = smooth_min(
        capsule(p, (0.0, MOUTH_Y - 0.46 * full, 9.25), mid, low, low * 0.95),
        capsule(p, mid, corner, low * 0.95, 0.10),
        0.25,
    )
    d = smooth_min(smooth_min(d, upper, 0.35), lower, 0.35)
    philtrum = capsule(p, (0, -2.3, 9.75), (0, MOUTH_Y + 0.75 * full, 10.05), 0.26, 0.2)
    d = smooth_cut(d, philtrum, 0.35)
    crease = capsule(p, (0, -6.05, 9.55), (0.9, -6.0, 9.35), 0.35, 0.3)
    d = smooth_cut(d, crease, 0.8)
    line = capsule(p, (0, MOUTH_Y, 9.95), (half * 0.6, MOUTH_Y, 9.45), 0.10, 0.08)
    line = np.minimum(
        line, capsule(p, (half * 0.6, MOUTH_Y, 9.45), (half + 0.05, MOUTH_Y, 8.4), 0.08, 0.10)
    )
    return smooth_cut(d, line, 0.25)
