"""Person masks and mattes of a whole clip, streaming, the heavy parts on a few threads.

T frames, S the side of the crop in px.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from dubbing.face.mesh_points import EYE_CORNERS, NOSE_BRIDGE
from dubbing.media import VideoWriter
from dubbing.preparation.alignment.silhouette import measure
from dubbing.preparation.footage.footage import OPACITY, PERSON, Footage, new_pictures
from dubbing.preparation.footage.threads import in_order
from dubbing.preparation.matting.jaw import edge_costs, edge_offsets, moved, smooth_offsets
from dubbing.preparation.matting.matting import (
    component_at,
    head_matte,
    in_bytes,
    opacity,
)
from dubbing.preparation.matting.person_masks import PersonMasks

Progress = Callable[[float], None]


class People:
    """Person masks and opacities of the persons of all crops, left in a folder, frame by frame."""

    def __init__(self, folder: Path, crops: np.ndarray, person_masks: PersonMasks) -> None:
        self._person_masks = person_masks
        self._crops = crops
        self._masks = new_pictures(folder / PERSON, *crops.shape[:3])
        self._opacities = new_pictures(folder / OPACITY, *crops.shape[:3])

    def look(self, t: int, landmarks: np.ndarray | None) -> np.ndarray:
        """Write those of a frame, and measure the outline of its head.

        Args:
            landmarks: (478, 2 or more) px of the crop, None where they are not known.

        Returns:
            Middle and top of the head (2, 2) px, NaN where not seen; see :class:`Silhouette`.
        """
        mask = self._person_masks(self._crops[t])
        alpha = opacity(self._crops[t], mask)
        self._masks[t], self._opacities[t] = in_bytes(mask), in_bytes(alpha)
        if landmarks is None:
            return np.full((2, 2), np.nan)
        corners = landmarks[list(EYE_CORNERS), :2]
        # Somebody beside them is no part of the outline.
        alpha[~component_at(alpha > 0.1, corners.mean(0))] = 0
        return np.stack(measure(alpha, corners))


def jaw_lines(footage: Footage, progress: Progress) -> np.ndarray:
    """The outlines moved to the edge of the jaw that is seen, (T, POINTS, 2) px."""

    def work(t: int) -> np.ndarray:
        return edge_costs(footage.crops[t], footage.outline[t])

    costs = []
    for cost in in_order(work, ((t,) for t in range(len(footage)))):
        costs.append(cost)
        progress(len(costs) / len(footage))
    offsets = edge_offsets(np.stack(costs), footage.size)
    smooth = smooth_offsets(offsets, footage.segment)
    return np.stack([moved(*pair) for pair in zip(footage.outline, smooth, strict=True)])


def matte_step(footage: Footage, matte: Path, progress: Progress) -> None:
    """Write the matte; frames that do not show the head get an empty one."""
    size = footage.size
    lines = jaw_lines(footage, lambda share: progress(0.2 * share))

    def work(t: int) -> np.ndarray:
        if not footage.valid[t]:
            return np.zeros((size, size), np.uint8)
        return head_matte(footage.opacity[t], lines[t], footage.landmarks[t, NOSE_BRIDGE])

    with VideoWriter(matte, size, size, footage.info.rate, "ffv1-gray") as mattes:
        for alpha in in_order(work, ((t,) for t in range(len(footage)))):
            mattes.write(alpha)
            progress(0.2 + 0.8 * mattes.frames / len(footage))
