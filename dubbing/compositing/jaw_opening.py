"""How a jaw opens: which way its chin moves, and what moves with it. S is the side of the crop."""

import numpy as np

from dubbing.compositing.face_mask import DOWNWARDS, FAR_FROM_MOUTH, NEAR_MOUTH, from_lips
from dubbing.face.mesh_points import (
    CHIN,
    FOREHEAD_TOP,
    JAW_BACK,
    LEFT_EAR,
    NOSE_TIP,
    RIGHT_EAR,
)
from dubbing.preparation.matting.matting import REFERENCE_SIZE

DEEP = 0.6  # from the tip of the nose to the ears, in heights of the face
# Px by which a chin rises, and parts of the way it opens that lie across the face, between which it
# comes off the clothes that it touches.
RISE, TURNED = (12.0, 24.0), (0.34, 0.5)
# Heights above the middle of the lips, of the face's, between which the jaw's motion fades out.
STILL, MOVING = 0.02, -0.08
HINGED = 0.15  # of them beside the mouth from which it fades: a jaw hinges at the ears


def opening_way(landmarks: np.ndarray) -> np.ndarray:
    """The way that a chin moves when a jaw opens, (2,): down, and back where that can be seen."""
    height = max(float(np.linalg.norm(landmarks[CHIN] - landmarks[FOREHEAD_TOP])), 1.0)
    back = landmarks[[LEFT_EAR, RIGHT_EAR]].mean(0) - landmarks[NOSE_TIP]
    return np.asarray(down(landmarks) + JAW_BACK * back / DEEP / height)


def touching(motion: np.ndarray, landmarks: np.ndarray, size: int) -> float:
    """Share 0..1 of a jaw that rises that stays where it touches clothes.

    Nobody has seen what a chin that rises a little uncovers there. It is skin, so skin stretches.
    Behind a head that turns there is a wall, too, which other frames show.
    """
    rise = -float(motion @ down(landmarks)) * REFERENCE_SIZE / size
    return float((rise > 0) * falling(np.array(rise), RISE) * (1 - comes_off(landmarks)))


def comes_off(landmarks: np.ndarray) -> float:
    """Share 0..1 to which a chin comes off what it touches when it rises: a turned one does."""
    (x, y), (across, along) = opening_way(landmarks), down(landmarks)
    return 1 - float(falling(np.abs(x * along - y * across), TURNED))


def down(landmarks: np.ndarray) -> np.ndarray:
    """The unit vector (2,) from the forehead to the chin, in the picture."""
    way = landmarks[CHIN] - landmarks[FOREHEAD_TOP]
    return np.asarray(way / max(float(np.hypot(*way)), 1.0))


def moving_share(landmarks: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Share of the jaw's motion at places, px: 1 at the chin, 0 above the lips and far from it."""
    above, beside = from_lips(landmarks, x, y)
    low = np.clip((STILL - above) / (STILL - MOVING), 0, 1)
    down = np.abs(above / DOWNWARDS)
    away = np.hypot(beside, down)
    fades = HINGED + (NEAR_MOUTH - HINGED) * down / np.maximum(away, 1e-6)
    near = np.clip((FAR_FROM_MOUTH - away) / (FAR_FROM_MOUTH - fades), 0, 1)
    share: np.ndarray = smooth(low) * smooth(near)
    return share


def smooth(share: np.ndarray) -> np.ndarray:
    """A share 0..1 that rises and ends without a bend."""
    return share * share * (3 - 2 * share)


def falling(away: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """1 up to the first limit, 0 from the second on."""
    near, far = limits
    share: np.ndarray = np.clip((far - away) / (far - near), 0, 1)
    return share
