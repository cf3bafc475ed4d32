"""The relief of the skin, found together with the poses from pixels.

N points, K bumps, T frames. To first order a turn by w moves a point by w times its depth: a face
drawn too flat turns too far, and where the depths are wrong one against another, one axis turns
for the other. So the depth of the skin, as seen from the reference frame, may bend by smooth bumps:

    Y_n(c) = Y_n + v_n sum_k phi_k(x_n, y_n) c_k,   phi_k a Gaussian on a grid, v_n along the ray

and c is solved with all poses by Gauss-Newton on the photometric residuals (:mod:`photometric`),
with |c|^2 / .05^2. One number the pixels hardly know, as a deeper face that turns less looks
nearly alike (the bas-relief ambiguity, Belhumeur et al. 1999): the slope of the new depths on the
old ones. It is held at the slope of the landmarks' shape, by (g c)^2 / .01^2, g that slope.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

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
    """How far skin moves along the rays of a camera that stands at `eye` (3,) of the head frame.

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
    """Linear form (K,): slope on z of depths that are added, with a plane left free."""
    x, y, z = (skin.points - skin.points.mean(0)).T
    known = np.stack((z, x, y, np.ones_like(z)), axis=1)
    return np.asarray(np.linalg.lstsq(known, basis, rcond=None)[0][0])


def solve_relief(
    poses: Poses,
    work: Alignment,
    shape: np.ndarray,
    seen: Observations,
    reference: Poses,
    progress: Callable[[float], None],
) -> tuple[Relief, Texture]:
    """Relief of the skin, and its mean texture with the poses that go with it.

    Args:
        poses: start, within a few px.
        work: skin without relief, and its pictures.
        shape: (P, 3) rigid landmarks, observed by ``seen``.
        reference: pose (1,) from which the skin was projected back.
    """
    relief = Relief.flat(work.skin, reference)
    rays, basis = relief.rays(work.skin), relief.basis(work.skin)
    slope = slope_of(work.skin, basis)
    prior = np.eye(basis.shape[1]) / BUMP_SIGMA**2 + np.outer(slope, slope) / SLOPE_SIGMA**2
    usable = np.flatnonzero(seen.usable)
    for done in range(ROUNDS):
        bent = work.with_skin(relief.bend(work.skin))
        texture = texture_of(poses, usable, bent)
        for step in range(STEPS):
            bent = work.with_skin(relief.bend(work.skin))
            rest = beside_pixels(poses, shape, seen)
            matrix, right = pixel_equations(poses, seen, bent, texture, (rays, basis))
            both = NormalEquations(
                rest.diagonal + matrix[:, :DOF, :DOF], rest.right + right[:, :DOF]
            )
            border, corner = matrix[:, :DOF, DOF:], prior + matrix[:, DOF:, DOF:].sum(0)
            low = right[:, DOF:].sum(0) - prior @ relief.height
            band, right_pose = smoothed_system(poses, both, seen)
            pose_step, height_step = solve_bordered(
                band, border.reshape(-1, basis.shape[1]), corner, right_pose, low
            )
            poses = poses.stepped(pose_step.reshape(-1, DOF))
            relief = replace(relief, height=relief.height + height_step)
            progress((done * STEPS + step + 1) / (ROUNDS * STEPS))
    bent = work.with_skin(relief.bend(work.skin))
    return relief, texture_of(poses, usable, bent)
