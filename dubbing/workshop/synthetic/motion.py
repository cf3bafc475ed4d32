"""How the speaker holds the head: smooth motion about the neck, blinks, glances."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from dubbing.workshop.synthetic.rendering.camera import FLIP, UNIT, Pose

PIVOT = np.array([0.0, -8.5, -3.5])  # the neck's joint in the head frame used inside, cm
SPREAD_DEGREES = (3.2, 6.5, 2.4)  # standard deviations of pitch, yaw and roll at motion = 1
LIMIT_DEGREES = (9.0, 19.0, 7.0)
BLINK_SECONDS = (0.08, 0.05, 0.15)  # closing, closed, opening


@dataclass(frozen=True)
class Motion:
    """Poses (T), blink (T,) 0 open to 1 shut, gaze (T, 2) degrees right and up."""

    poses: list[Pose]
    blink: np.ndarray
    gaze: np.ndarray


def move(
    frames: int,
    rate: Fraction,
    *,
    seed: int,
    rest: np.ndarray,
    opening: np.ndarray,
    amount: float,
    turns: np.ndarray | None = None,
) -> Motion:
    """The motion of a clip.

    rest (3,) is the head's place at rest in camera axes, cm; opening (T,) is how open the mouth
    is (0..1), whose stresses the head follows with small nods; amount scales the motion; turns
    (T, 2) are pitch and yaw to add, degrees.
    """
    rng = np.random.default_rng(seed)
    fps = float(rate)
    slow = np.stack([_noise(rng, frames, 0.55 * fps) for _ in range(3)], axis=1)
    quick = np.stack([_noise(rng, frames, 0.16 * fps) for _ in range(3)], axis=1)
    angles = (slow + 0.22 * quick) * np.array(SPREAD_DEGREES)
    angles[:, 0] += 2.0 * gaussian_filter1d(opening, 0.12 * fps, mode="nearest")
    limit = np.array(LIMIT_DEGREES)
    angles = amount * limit * np.tanh(angles / limit)
    if turns is not None:
        angles[:, :2] += turns
    sway = amount * np.stack([_noise(rng, frames, 0.7 * fps) for _ in range(3)], axis=1)
    poses = []
    for (pitch, yaw, roll), drift in zip(angles, sway * np.array([0.25, 0.12, 0.4]), strict=True):
        turn = Rotation.from_euler("YXZ", [yaw, pitch, roll], degrees=True).as_matrix()
        shift = rest + drift + PIVOT - turn @ PIVOT
        poses.append(Pose(FLIP @ turn @ FLIP, FLIP @ shift / UNIT))
    return Motion(poses, _blinks(rng, frames, fps), _glances(rng, frames, fps))


def _noise(rng: np.random.Generator, frames: int, sigma: float) -> np.ndarray:
    """Smooth noise of unit standard deviation (in the long run), (frames,)."""
    pad = int(4 * sigma) + 1
    white = rng.standard_normal(frames + 2 * pad)
    smooth = gaussian_filter1d(white, sigma)[pad : pad + frames]
    return smooth * np.sqrt(2.0 * np.sqrt(np.pi) * sigma)


def _blinks(rng: np.random.Generator, frames: int, fps: float) -> np.ndarray:
    close, hold, reopen = BLINK_SECONDS
    times = (np.arange(frames) + 0.5) / fps
    blink = np.zeros(frames)
    at = float(rng.uniform(0.6, 2.0))
    while at < frames / fps:
        t = times - at
        down = np.clip(t / close, 0.0, 1.0)
        up = np.clip((t - close - hold) / reopen, 0.0, 1.0)
        blink = np.maximum(blink, down * down * (3 - 2 * down) - up * up * (3 - 2 * up))
        at += float(rng.uniform(1.8, 4.5))
    return np.clip(blink, 0.0, 1.0)


def _glances(rng: np.random.Generator, frames: int, fps: float) -> np.ndarray:
    """Small jumps of the view direction around the camera."""
    gaze = np.zeros((frames, 2))
    start = 0
    while start < frames:
        stop = start + max(1, int(rng.uniform(0.5, 2.2) * fps))
        gaze[start:stop] = rng.normal(0.0, (2.2, 1.0))
        start = stop
    return gaze
