"""The relief of the skin, solved together with the poses from pixels.

N points, K bumps, T frames. To first order a turn by w moves a point by w times its depth. So a
face that is too flat turns too far, and wrong relative depths mix up the axes of rotation. The
depth of the skin, from the view of the reference frame, may therefore bend by smooth bumps:

    Y_n(c) = Y_n + v_n sum_k phi_k(x_n, y_n) c_k,   phi_k a Gaussian on a grid, v_n along the ray

and c is solved with all poses by Gauss-Newton on the photometric residuals (:mod:`photometric`),
with |c|^2 / .05^2. The pixels hardly determine one number, the slope of the new depths on the old
ones: a deeper face that turns less looks nearly the same (the bas-relief ambiguity, Belhumeur et
al. 1999). It is held at the slope of the landmarks' shape, by (g c)^2 / .01^2, g that slope.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.preparation.alignment.banded import DOF, NormalEquations, solve_bordered
from dubbing.preparation.alignment.bundle import Observations, smoothed_system
from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.alignment.photometric import Alignment
from dubbing.preparation.alignment.refinement import beside_pixels, pixel_equations
from dubbing.preparation.alignment.skin import Skin
from dubbing.preparation.alignment.texture import Texture, texture_of

SPACING = 0.3  # between bumps, and their spread
BUMP_SIGMA = 0.05
SLOPE_SIGMA = 0.01
ROUNDS = 4  # new mean textures
STEPS = 2


@dataclass(frozen=True)
class Relief:
    """Motion of the skin along the rays of a camera at `eye` (3,) of the head frame.

    bumps (K, 2): their centres (x, y); height (K,): in the units of the head, along rays whose
    step along the camera's axis `ahead` (3,) is 1.
    """

    eye: np.ndarray
    ahead: np.ndarray
    bumps: np.ndarray
    height: np.ndarray

    @staticmethod
    def flat(skin: Skin, pose: Poses) -> Relief:
        """Bumps of height 0 over the whole skin, seen from the pose (1,)."""
        low, high = skin.points[:, :2].min(0), skin.points[:, :2].max(0)
        count = np.maximum(np.ceil((high - low) / SPACING).astype(int) + 1, 2)
        axes = [np.linspace(low[k], high[k], count[k]) for k in range(2)]
        bumps = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        rotation, translation = pose.rotation[0], pose.translation[0]
        return Relief(-rotation.T @ translation, rotation[2], bumps, np.zeros(len(bumps)))

    def rays(self, skin: Skin) -> np.ndarray:
        """Directions (N, 3) in which the skin's points move."""
        ray = skin.points - self.eye
        return np.asarray(ray / (ray @ self.ahead)[:, None])

    def basis(self, skin: Skin) -> np.ndarray:
        """Bumps at the skin's points, (N, K)."""
        apart = ((skin.points[:, None, :2] - self.bumps) ** 2).sum(-1)
        return np.asarray(np.exp(-apart / (2 * SPACING**2)))

    def bend(self, skin: Skin) -> Skin:
        """The skin with its points moved."""
        moved = skin.points + self.rays(skin) * (self.basis(skin) @ self.height)[:, None]
        return Skin(moved, skin.normals)


def slope_of(skin: Skin, basis: np.ndarray) -> np.ndarray:
    """Linear form (K,): slope on z of added depths, with a plane left free."""
    x, y, z = (skin.points - skin.points.mean(0)).T
    known = np.stack((z, x, y, np.ones_like(z)), axis=1)
    return np.asarray(np.linalg.lstsq(known, basis, rcond=None)[0][0])


def solve_relief(
    poses: Poses,
    work: Alignment,
    shape: np.ndarray,
    observed: Observations,
    reference: Poses,
    progress: ReportShare,
) -> tuple[Relief, Texture]:
    """Relief of the skin, and its mean texture at the poses solved with it.

    Args:
        poses: start, within a few px.
        work: skin without relief, and its images.
        shape: (P, 3) rigid landmarks, of which ``observed`` has the pixels.
        reference: pose (1,) from which the skin was projected back.
    """
    relief = Relief.flat(work.skin, reference)
    rays, basis = relief.rays(work.skin), relief.basis(work.skin)
    slope = slope_of(work.skin, basis)
    prior = np.eye(basis.shape[1]) / BUMP_SIGMA**2 + np.outer(slope, slope) / SLOPE_SIGMA**2
    usable = np.flatnonzero(observed.usable)
    for done in range(ROUNDS):
        bent = work.with_skin(relief.bend(work.skin))
        texture = texture_of(poses, usable, bent)
        for step in range(STEPS):
            bent = work.with_skin(relief.bend(work.skin))
            rest = beside_pixels(poses, shape, observed)
            matrix, right = pixel_equations(poses, observed, bent, texture, (rays, basis))
            both = NormalEquations(
                rest.diagonal + matrix[:, :DOF, :DOF], rest.right + right[:, :DOF]
            )
            border, corner = matrix[:, :DOF, DOF:], prior + matrix[:, DOF:, DOF:].sum(0)
            low = right[:, DOF:].sum(0) - prior @ relief.height
            band, right_pose = smoothed_system(poses, both, observed)
            pose_step, height_step = solve_bordered(
                band, border.reshape(-1, basis.shape[1]), corner, right_pose, low
            )
            poses = poses.stepped(pose_step.reshape(-1, DOF))
            relief = replace(relief, height=relief.height + height_step)
            progress((done * STEPS + step + 1) / (ROUNDS * STEPS))
    bent = work.with_skin(relief.bend(work.skin))
    return relief, texture_of(poses, usable, bent)
