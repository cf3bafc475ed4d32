"""Person masks and mattes of a whole clip, frame by frame, on a few threads.

T frames, S the side of the crop in px.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.face.face_contour import evenly
from dubbing.face.finding.graph_network import network
from dubbing.face.finding.regions import Images
from dubbing.face.mesh_points import EYE_CORNERS, NOSE_BRIDGE
from dubbing.face.weight_paths import PERSON_MASK
from dubbing.media import VideoWriter
from dubbing.preparation.alignment.silhouette import measure
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.crops.tracked_crops import OPACITY, PERSON, TrackedCrops, create_images
from dubbing.preparation.matting.beard import FRAMES, Beard, JawColours, jaw_colours
from dubbing.preparation.matting.jaw import (
    OPEN_PROFILE,
    POINTS,
    PROFILE,
    SHAVEN,
    edge_costs,
    edge_offsets,
    expect_as_around,
    moved,
    normals,
    smooth_offsets,
    turned_share,
)
from dubbing.preparation.matting.matting import (
    REFERENCE_SIZE,
    above,
    component_at,
    head_matte,
    in_bytes,
    opacity,
)

INPUT_SIDE = 256  # px, side of the network's input
MOST_UNSURE = 0.8  # of a jaw line of a turned head; that of a bearded one says nothing
# px at 512: single hairs reach so far below the edge of a beard, and would be left behind, as would
# some of the jaw of a profile.
TIPS = 9.0
NO_BEARD = Beard(0.0, np.zeros((POINTS, 3)))
BATCH = 4  # images at once: more do not fit a core's cache


def person_masks(images: Images) -> list[np.ndarray]:
    """Probabilities (S, S) float32 in 0..1 that pixels of RGB images belong to a person."""
    found: list[np.ndarray] = []
    for start in range(0, len(images), BATCH):
        part = images[start : start + BATCH]
        side = (INPUT_SIDE, INPUT_SIDE)
        small = np.stack([cv2.resize(k, side, interpolation=cv2.INTER_AREA) for k in part])
        (masks,) = network(PERSON_MASK)(small)
        for image, mask in zip(part, masks[:, 0], strict=True):
            found.append(cv2.resize(mask, image.shape[1::-1], interpolation=cv2.INTER_LINEAR))
    return found


class People:
    """Writes person masks and opacities of all crops into a folder, frame by frame."""

    def __init__(self, folder: Path, crops: np.ndarray) -> None:
        self._crops = crops
        self._masks = create_images(folder / PERSON, *crops.shape[:3])
        self._opacities = create_images(folder / OPACITY, *crops.shape[:3])

    def look(self, first: int, landmarks: Sequence[np.ndarray | None]) -> np.ndarray:
        """Write masks and opacities of frames in a row, and measure the outlines of their heads.

        Args:
            first: number of the first frame.
            landmarks: of each frame (478, 2 or more) px of the crop, None where not known.

        Returns:
            Middles and tops of the heads (2, B, 2) px, NaN where not visible; see
            :class:`Silhouette`.
        """
        crops = self._crops[first : first + len(landmarks)]
        masks = zip(crops, person_masks(crops), landmarks, strict=True)
        return np.stack([self._write(first + k, *each) for k, each in enumerate(masks)], axis=1)

    def _write(
        self, t: int, crop: np.ndarray, mask: np.ndarray, landmarks: np.ndarray | None
    ) -> np.ndarray:
        alpha = opacity(crop, mask)
        self._masks[t], self._opacities[t] = in_bytes(mask), in_bytes(alpha)
        if landmarks is None:
            return np.full((2, 2), np.nan)
        corners = landmarks[list(EYE_CORNERS), :2]
        # Other people in the crop are no part of the outline.
        alpha[~component_at(alpha > 0.1, corners.mean(0))] = 0
        return np.stack(measure(alpha, corners))


def jaw_lines(clip: TrackedCrops, beards: Sequence[Beard], progress: ReportShare) -> np.ndarray:
    """The outlines moved to the visible edge of the jaw, (T, POINTS, 2) px.

    Args:
        beards: see `beards_of_shots`.
    """
    every = np.array([beard.share for beard in beards])[clip.segment]
    unsure = np.maximum(every, [MOST_UNSURE * turned_share(points) for points in clip.landmarks])

    profile = np.array([turned_share(points, PROFILE) > 0.5 for points in clip.landmarks])
    reach = np.where(profile, OPEN_PROFILE, SHAVEN)

    def work(t: int) -> np.ndarray:
        colours = colours_of(clip, t).usual(beards[clip.segment[t]]) if every.any() else None
        frame = clip.crops[t], clip.opacity[t], clip.outline[t]
        cost = edge_costs(*frame, unsure[t], colours, reach[t])
        further = max(0, reach.max() - cost.shape[1])
        return np.pad(cost, ((0, 0), (0, further)), constant_values=np.inf)

    costs = []
    for cost in in_order(work, ((t,) for t in range(len(clip)))):
        costs.append(cost)
        progress(len(costs) / len(clip))
    found = np.stack(costs)
    for shot in np.unique(clip.segment[unsure > 0]):
        index = clip.segment == shot
        found[index] = expect_as_around(found[index], unsure[index])
    smooth = smooth_offsets(edge_offsets(found, clip.size), clip.segment)
    return np.stack([moved(*pair) for pair in zip(clip.outline, smooth, strict=True)])


def above_line(clip: TrackedCrops, t: int, line: np.ndarray, beard: Beard) -> np.ndarray:
    """Coverage (S, S) uint8 of what may be the head of frame t.

    Below its line there may be some of the jaw of a profile, and hairs: what looks like the beard.

    Args:
        line: see `jaw_lines`. beard: that of the shot.
    """
    face, profile = above(line, clip.size), turned_share(clip.landmarks[t], PROFILE)
    if not max(beard.share, profile):
        return face
    tips = TIPS * clip.size / REFERENCE_SIZE
    below = above(moved(line, np.full(POINTS, max(beard.share, profile) * tips)), clip.size)
    if beard.share > profile:
        like = colours_of(clip, t).usual(beard).like_hairs(clip.crops[t])
        below = below * np.maximum(profile, like)
    return np.maximum(face, below).astype(np.uint8)


def beards_of_shots(clip: TrackedCrops) -> list[Beard]:
    """The person's beard in each shot."""
    found = [NO_BEARD] * (int(clip.segment[-1]) + 1)
    for shot in np.unique(clip.segment[clip.valid]):
        frames = np.flatnonzero((clip.segment == shot) & clip.valid)
        some = frames[:: max(1, len(frames) // FRAMES)]
        found[shot] = Beard.of([colours_of(clip, t) for t in some])
    return found


def colours_of(clip: TrackedCrops, t: int) -> JawColours:
    """Colours along the jaw line of frame t, and of its skin."""
    line = evenly(clip.outline[t], POINTS)
    return jaw_colours(clip.crops[t], clip.landmarks[t], line, normals(line))


def matte_step(clip: TrackedCrops, matte: Path, images: Path, progress: ReportShare) -> None:
    """Write the matte, as a video and as images; frames that do not show the head: an empty one."""
    size, alphas = clip.size, create_images(images, *clip.opacity.shape)
    beards = beards_of_shots(clip)
    lines = jaw_lines(clip, beards, lambda share: progress(0.2 * share))

    def work(t: int) -> np.ndarray:
        if not clip.valid[t]:
            return np.zeros((size, size), np.uint8)
        face = above_line(clip, t, lines[t], beards[clip.segment[t]])
        return head_matte(clip.opacity[t], face, clip.landmarks[t, NOSE_BRIDGE])

    with VideoWriter(matte, size, size, clip.info.rate, "ffv1-gray") as mattes:
        for t, alpha in enumerate(in_order(work, ((t,) for t in range(len(clip))))):
            alphas[t] = alpha
            mattes.write(alpha)
            progress(0.2 + 0.8 * mattes.frames / len(clip))
