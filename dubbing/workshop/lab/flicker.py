"""Temporal flicker of the upper face: what changes in it from frame to frame and should not.

Points of the skin round the brows and the bridge of the nose are followed by the known poses of the
head, so that they stand still, and the second differences of their grey values are taken. The
mouth, which has to move, and the lids are left out.

N points.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from dubbing.face.mesh_points import BROWS_AND_BRIDGE, LEFT_LIDS, RIGHT_LIDS
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.alignment.photometric import LEAST_FACING
from dubbing.preparation.alignment.skin import Skin, reference_frame, skin_points
from dubbing.preparation.prepared import PreparedClip


def brow_skin(clip: PreparedClip) -> Skin:
    """Skin from above the brows to the bridge of the nose, as a typical frame shows it."""
    poses = Poses(clip.rotation, clip.translation)
    typical = np.array([reference_frame(poses, clip.valid)])
    return skin_points(
        clip.shape,
        poses[typical],
        clip.focal,
        clip.centre[typical],
        clip.size,
        outline=BROWS_AND_BRIDGE,
        holes=(LEFT_LIDS, RIGHT_LIDS),
    )


class Flicker:
    """Adds up squared second differences of a render and of its source, frame by frame.

    Only three frames in a row of one shot, all with a face, make a difference. Three frames are all
    that is kept.
    """

    def __init__(self, clip: PreparedClip, skin: Skin) -> None:
        """skin: what is watched, N points of the clip's head frame."""
        self._clip = clip
        self._poses = Poses(clip.rotation, clip.translation)
        self._skin = skin
        self._last: list[np.ndarray] = []  # (2, N) render and source, of frames in a row
        self._frame = -1
        self._sum = np.zeros(2)
        self._number = 0

    def add(self, frame: int, rendered: np.ndarray, image: np.ndarray) -> None:
        """The next frame: its number in the clip, render and source (S, S, 3) uint8."""
        valid, shot = self._clip.valid, self._clip.segment
        if frame != self._frame + 1 or shot[frame] != shot[self._frame] or not valid[frame]:
            self._last.clear()
        self._frame = frame
        if not valid[frame]:
            return
        at = self._pixels(frame)
        self._last.append(np.stack([_sampled(rendered, at), _sampled(image, at)]))
        if len(self._last) == 3:
            before, now, after = self._last
            second = before - 2 * now + after
            known = np.isfinite(second).all(0)
            self._sum += (second[:, known] ** 2).sum(1)
            self._number += int(known.sum())
            self._last.pop(0)

    def figures(self) -> dict[str, float]:
        """`source_flicker`, rms second difference of the source in grey levels; and `flicker`.

        The latter is that of the render as a multiple of it, where it is not 0.
        """
        if not self._number:
            return {}
        render, source = (float(rms) for rms in np.sqrt(self._sum / self._number))
        return {"source_flicker": source, **({"flicker": render / source} if source else {})}

    def _pixels(self, frame: int) -> np.ndarray:
        """Where the points are in a frame, (N, 2) px, NaN where they face away."""
        pose = self._poses[np.array([frame])]
        in_camera = to_camera(pose, self._skin.points)
        at = project(in_camera, self._clip.focal, self._clip.centre[[frame]])[0]
        normals = self._skin.normals @ pose.rotation[0].T
        rays = in_camera[0] / np.linalg.norm(in_camera[0], axis=1, keepdims=True)
        return np.where((-(normals * rays).sum(1) < LEAST_FACING)[:, None], np.nan, at)


def _sampled(image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Grey values (N,) at pixels (N, 2) of an image (S, S, 3) uint8, NaN outside of it.

    By cubic splines: bilinear samples are the softer the further they lie from a pixel's middle, so
    a sharp image that moves would flicker by being sampled.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float64)
    inside = (at >= 0).all(1) & (at <= np.array(grey.shape[::-1]) - 1).all(1)
    values = np.full(len(at), np.nan)
    values[inside] = map_coordinates(grey, at[inside, ::-1].T, order=3, mode="mirror")
    return values
