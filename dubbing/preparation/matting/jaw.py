"""Refines the lower edge of the jaw, or of the beard on it, to the pixel.

FaceMesh gives the jaw to a few px and ignores beards. The true edge is searched along the normals
of its line: the smooth line of strongest colour steps near it, by dynamic programming (an active
contour: Amini, Weymouth and Jain 1990). Where no edge separates skin from skin, the line stays.
Below a beard the edge lies where what looks like the beard ends, however far that is.

S is the side of the crop in px. Lengths are for S = 512 and scale with it.
"""

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter, percentile_filter

from dubbing.face.face_contour import evenly
from dubbing.face.mesh_points import LEFT_EAR, NOSE_TIP, RIGHT_EAR
from dubbing.preparation.matting.beard import JawColours
from dubbing.preparation.matting.matting import OPAQUE, REFERENCE_SIZE

POINTS = 96  # of the line
SPACING = 1.0  # px
OFFSETS = np.arange(-5.0, 80.0 + SPACING / 2, SPACING)  # px along a normal
# Of them are looked at where nobody has a beard, and in a profile: up to 30 and to 50 px.
SHAVEN, OPEN_PROFILE = 36, 56
# px: expected distance of the edge from FaceMesh's line, the last one of a beard or a turned head.
ABOVE, BELOW, FAR_BELOW = 2.5, 14.0, 35.0
# Distances of the nose from the middle between the ears, as shares of theirs: 25 and 35 degrees,
# 40 and 60.
TURNED, PROFILE = (0.21, 0.41), (1.0, 2.0)
LIKE_BEARD = 0.25  # reward of a px that looks like the beard, cost of one that looks like skin
STEP = 5  # px on either side whose means are compared
CLEAR = 60.0  # grey levels: a step of this height is worth half of MAX_REWARD
AROUND, USUAL, SPREAD = 60, 60, 8.0  # frames, percentile of the edges in these, px about it
MAX_REWARD = 3.0  # of a step: the white of a collar is no better a chin
# Reward where the person ends, and cost of what is beyond; of any face, and of a profile.
WALL, PROFILE_WALL = 6.0, 12.0
CROSSED = 0.012  # cost a px and grey level of steps crossed on the way outwards
BEND = 0.5  # cost of a step of one px from point to point, squared
ENDS = 0.06  # share of the line at each end, beside the ears, that does not move
MEDIAN_FRAMES, SMOOTH_FRAMES, SMOOTH_POINTS = 5, 1.0, 1.5


def normals(line: np.ndarray) -> np.ndarray:
    """Unit normals (P, 2) of a line (P, 2) that runs from left to right, pointing downwards."""
    along = gaussian_filter1d(np.gradient(line, axis=0), 2.0, axis=0, mode="nearest")
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)


def edge_costs(
    image: np.ndarray,
    person: np.ndarray,
    outline: np.ndarray,
    unsure: float = 0,
    beard: JawColours | None = None,
    reach: int = SHAVEN,
) -> np.ndarray:
    """Cost (POINTS, J) of the edge lying the first J OFFSETS below an outline (K, 2) px.

    Where a chin lies before the wall, as in a profile, its edge is that of the person: FaceMesh's
    line is then far off, and what is crossed on the way to the wall is the chin's own shading.

    Args:
        image: (S, S, 3) uint8 RGB. person: (S, S) uint8, opacity.
        unsure: 0..1, how little FaceMesh's line says of the edge.
        beard: colours of the jaw, where there may be one.
        reach: J where there is no beard.
    """
    unit = len(image) / REFERENCE_SIZE
    line = evenly(outline, POINTS)
    offsets = OFFSETS if beard else OFFSETS[:reach]
    places = line[:, None] + (offsets * unit)[:, None] * normals(line)[:, None]
    smooth = cv2.GaussianBlur(image, (0, 0), unit)
    x, y = (places[..., k].astype(np.float32) for k in range(2))
    colour = cv2.remap(smooth, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    step = np.linalg.norm(steps(colour.astype(np.float32), STEP), axis=2)
    far = np.where(offsets < 0, offsets / ABOVE, offsets / (BELOW + unsure * (FAR_BELOW - BELOW)))
    outward = np.where(offsets >= 0, step, 0) * (1 - unsure)  # nor are a beard's hairs edges
    passed = np.cumsum(outward, axis=1) - outward
    passed = np.pad(passed, ((0, 0), (STEP, 0)))[:, : len(offsets)]
    inside = cv2.remap(person, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) >= OPAQUE
    ends = np.where((inside.all(1) | ~inside[:, 0])[:, None], np.inf, inside.argmin(1)[:, None])
    wall = WALL
    # A chin that is open may lie behind the line. Its lowest point: is there no neck below it?
    if np.isfinite(ends[np.where(inside[:, 0], line[:, 1], -np.inf).argmax()]):
        wall, passed = PROFILE_WALL, np.where(np.isfinite(ends), 0, passed)
    cost = far**2 / 2 - MAX_REWARD * step / (step + CLEAR) + CROSSED * SPACING * passed
    if beard:
        unlike = beard.share * np.where(offsets >= 0, beard.unlike(colour), 0)
        cost += LIKE_BEARD * SPACING * (np.cumsum(unlike, axis=1) - unlike)
    place = np.arange(len(offsets))
    cost += np.where(place > ends, wall, np.where(place >= ends - 1, -wall, 0))
    still = round(ENDS * POINTS)
    for end in (slice(0, still), slice(POINTS - still, None)):
        cost[end] = offsets**2
    return cost.astype(np.float32)  # of a film of an hour they are many


def turned_share(landmarks: np.ndarray, least_most: tuple[float, float] = TURNED) -> float:
    """How far a head with landmarks (478, 2) is turned: 0 up to the least of two, 1 from the most.

    The jaw of a turned head is that of a mean face, and may be far off.
    """
    left, right, nose = landmarks[[LEFT_EAR, RIGHT_EAR, NOSE_TIP]]
    across = right - left
    place = float((nose - left) @ across / max(float(across @ across), 1e-6))
    return float(np.interp(abs(place - 0.5), least_most, (0, 1)))


def edge_offsets(costs: np.ndarray, size: int) -> np.ndarray:
    """Offsets of the edges below the outlines at their POINTS points, (T, POINTS) px.

    Args:
        costs: (T, POINTS, J), from :func:`edge_costs`. size: S.
    """
    bend = BEND * (SPACING * np.arange(-2, 3)) ** 2
    return OFFSETS[smoothest(costs, bend)] * (size / REFERENCE_SIZE)


def expect_as_around(costs: np.ndarray, unsure: np.ndarray) -> np.ndarray:
    """Costs (T, POINTS, J) of the frames of a shot, whose edges are expected as in most around.

    Args:
        costs: of the same shape. unsure: (T,) 0..1, how little FaceMesh's line says of the edge.
    """
    # scipy's own reflection reads outside of arrays much shorter than the window.
    around = ((AROUND, AROUND), (0, 0))
    found = np.pad(edge_offsets(costs, REFERENCE_SIZE), around, mode="symmetric")
    found = percentile_filter(found, USUAL, (2 * AROUND + 1, 1))[AROUND : len(found) - AROUND]
    usual = gaussian_filter1d(found.astype(float), SMOOTH_POINTS, axis=1, mode="nearest")
    offsets = OFFSETS[: costs.shape[2]]
    nearer = ((offsets - usual[..., None]) / SPREAD) ** 2 - (offsets / FAR_BELOW) ** 2
    return (costs + unsure[:, None, None] * nearer / 2).astype(np.float32)


def steps(profile: np.ndarray, reach: int) -> np.ndarray:
    """Mean of the `reach` samples after each sample minus that of those before it, (P, J, C)."""
    padded = np.pad(profile, ((0, 0), (reach, reach), (0, 0)), mode="edge")
    total = np.pad(padded.cumsum(1), ((0, 0), (1, 0), (0, 0)))
    count = profile.shape[1]
    before = total[:, reach : reach + count] - total[:, :count]
    after = (
        total[:, 2 * reach + 1 : 2 * reach + 1 + count] - total[:, reach + 1 : reach + 1 + count]
    )
    return (after - before) / reach


def smoothest(cost: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Paths of least cost through (T, P, J), one state a point: (T, P) int.

    Args:
        cost: of each state at each point.
        bend: (2 R + 1,) cost of moving by -R .. R states; larger moves are not possible.
    """
    reach, states = len(bend) // 2, cost.shape[2]
    total, came = cost[:, 0], np.zeros(cost.shape, np.int16)
    for k in range(1, cost.shape[1]):
        padded = np.pad(total, ((0, 0), (reach, reach)), constant_values=np.inf)
        # From state j + r at the point before.
        choices = np.stack([padded[:, r : r + states] + bend[r] for r in range(2 * reach + 1)])
        came[:, k] = choices.argmin(0) - reach + np.arange(states)
        total = choices.min(0) + cost[:, k]
    every = np.arange(len(cost))
    path = [total.argmin(1)]
    for k in range(cost.shape[1] - 1, 0, -1):
        path.append(came[every, k, path[-1]])
    return np.stack(path[::-1], axis=1)


def smooth_offsets(offsets: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Offsets (T, POINTS) without flicker, smoothed shot by shot (segment (T,) int)."""
    out = offsets.copy()
    for shot in np.unique(segment):
        index = segment == shot
        part = median_filter(out[index], (MEDIAN_FRAMES, 1), mode="nearest")
        part = gaussian_filter1d(part, SMOOTH_FRAMES, axis=0, mode="nearest")
        out[index] = gaussian_filter1d(part, SMOOTH_POINTS, axis=1, mode="nearest")
    return out


def moved(outline: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The line (POINTS, 2) px that lies offsets (POINTS,) px below an outline (K, 2)."""
    line = evenly(outline, POINTS)
    return line + offsets[:, None] * normals(line)
