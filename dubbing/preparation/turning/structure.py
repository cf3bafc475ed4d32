"""Poses and points from tracks of points: structure from motion.

Minimised over the free poses and all points by Levenberg and Marquardt's method (Triggs et al.
2000), with Huber's loss:

    sum_o rho(|pi(R_t X_p + T_t) - u_o|) + sum_p |X_p - X0_p|^2 / s^2 + sum_t |d2 x_t|^2 / b^2

The points are eliminated (Schur complement). F frames, O observations of P points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix

from dubbing.preparation.alignment.banded import DOF, HUBER, huber_weight, smoothness_blocks
from dubbing.preparation.alignment.camera import (
    Poses,
    point_jacobian,
    pose_jacobian,
    relative_vectors,
)
from dubbing.preparation.turning.point_tracks import PointTracks

PIXEL = 0.5  # px, deviation of an observation
PLACE = 0.15  # units, by how much a first guess of a point is off
BEND = np.concatenate((np.full(3, np.radians(1.0)), np.full(3, 0.02)))
STEPS = 20
CHECKED = (6, 12)  # steps after which points that do not fit are left out
MISFIT = 1.2  # px, in the median over a point's frames
DAMPING, MOST_DAMPING = 1e-3, 1e4
ENOUGH = 1e-4  # of the cost: a smaller gain ends the iteration


@dataclass(frozen=True)
class _State:
    """Poses (F) and places (P, 3), with residuals (O, 2), and points in the camera (O, 3)."""

    poses: Poses
    places: np.ndarray
    residual: np.ndarray
    in_camera: np.ndarray
    cost: float


class Structure:
    """Solves for the poses of frames and the places of points.

    Args:
        tracks: of the points. focal: px. centre: (F, 2) principal points.
    """

    def __init__(self, tracks: PointTracks, focal: float, centre: np.ndarray) -> None:
        self._tracks, self._focal, self._centre = tracks, focal, centre[tracks.frame]
        self._fits = np.ones(len(tracks.places), bool)

    def poses(self, start: Poses, free: np.ndarray) -> Poses:
        """Poses (F) of all frames; those that are not free (F,) stay as they are."""
        state, damping = self._state(start, self._tracks.places), DAMPING
        for step in range(STEPS):
            system = self._system(state, free)
            new = None
            while new is None or not new.cost < state.cost:  # nor where it is not a number
                new = self._stepped(state, system, free, damping)
                damping = max(damping / 5, 1e-6) if new.cost < state.cost else damping * 5
                if damping > MOST_DAMPING:
                    return state.poses
            gain, state = (state.cost - new.cost) / state.cost, new
            if step in CHECKED:
                self._leave_out(state)
                state = self._state(state.poses, state.places)
            elif step > CHECKED[-1] and gain < ENOUGH:
                break
        return state.poses

    def _leave_out(self, state: _State) -> None:
        """Points that do not move with the head: reflections, and edges that slide."""
        away = np.linalg.norm(state.residual, axis=1)
        order = np.lexsort((away, self._tracks.point))
        count = np.bincount(self._tracks.point, minlength=len(self._fits))
        middle = np.cumsum(count) - count + count // 2
        self._fits = away[order][middle] < MISFIT

    def _state(self, poses: Poses, places: np.ndarray) -> _State:
        tracks = self._tracks
        turned = poses.rotation[tracks.frame] @ places[tracks.point][..., None]
        in_camera = turned[..., 0] + poses.translation[tracks.frame]
        residual = self._focal * in_camera[:, :2] / in_camera[:, 2:] + self._centre - tracks.pixels
        away = np.linalg.norm(residual, axis=1)
        limit = HUBER * PIXEL
        loss = np.where(away < limit, away**2 / 2, limit * (away - limit / 2))
        loss *= self._fits[tracks.point]
        moved = np.square((places - tracks.places) / PLACE).sum() / 2
        bent = np.square(_bends(poses) / BEND).sum() / 2
        return _State(poses, places, residual, in_camera, float(loss.sum() + moved + bent))

    def _system(self, state: _State, free: np.ndarray) -> _System:
        """Normal equations at a state: of the poses, of the points, and what joins them."""
        tracks, frames, count = self._tracks, len(state.poses), len(state.places)
        by_point = point_jacobian(state.in_camera[:, None], self._focal)[:, 0]
        shift = state.poses.translation[tracks.frame]
        by_pose = pose_jacobian(state.in_camera[:, None], shift, self._focal)[:, 0]
        by_point = by_point @ state.poses.rotation[tracks.frame]
        away = np.linalg.norm(state.residual, axis=1) / PIXEL
        weight = (huber_weight(away) * self._fits[tracks.point])[:, None, None]
        transposed = (by_pose * weight).transpose(0, 2, 1)
        diagonal = _summed(tracks.frame, frames, transposed @ by_pose)
        right = -_summed(tracks.frame, frames, transposed @ state.residual[..., None])[..., 0]
        own = (by_point * weight).transpose(0, 2, 1)
        inner = _summed(tracks.point, count, own @ by_point) + np.eye(3) / PLACE**2
        pull = -_summed(tracks.point, count, own @ state.residual[..., None])[..., 0]
        pull -= (state.places - tracks.places) / PLACE**2
        linked = np.zeros(frames, bool)
        linked[1:-1] = True
        middle, *beside = smoothness_blocks(linked, 1 / BEND**2)
        whole = _dense(diagonal + middle, *beside)
        bend = _bends(state.poses) / BEND**2
        for offset, factor in enumerate((1.0, -2.0, 1.0)):
            right[offset : frames - 2 + offset] -= factor * bend
        return _System(whole, right, inner, pull, transposed @ by_point)

    def _stepped(self, state: _State, system: _System, free: np.ndarray, damping: float) -> _State:
        tracks, frames, count = self._tracks, len(state.poses), len(state.places)
        inverse = np.linalg.inv(system.inner * (1 + damping * np.eye(3)))
        order = np.lexsort((tracks.point, tracks.frame))
        starts = np.searchsorted(tracks.frame[order], np.arange(frames + 1))
        joins = bsr_matrix(
            (system.joins[order], tracks.point[order], starts), shape=(DOF * frames, 3 * count)
        ).tocsr()
        blocks = bsr_matrix((inverse, np.arange(count), np.arange(count + 1)))
        through: csr_matrix = joins @ blocks.tocsr()
        matrix = system.whole - (through @ joins.T).toarray()
        matrix[np.diag_indices(len(matrix))] += damping * np.diag(system.whole)
        right = system.right.ravel() - through @ system.pull.ravel()
        moves = np.repeat(free, DOF)
        step = np.zeros(DOF * frames)
        step[moves] = np.linalg.solve(matrix[np.ix_(moves, moves)], right[moves])
        back = (system.pull.ravel() - joins.T @ step).reshape(-1, 3, 1)
        poses = state.poses.stepped(step.reshape(-1, DOF))
        return self._state(poses, state.places + (inverse @ back)[..., 0])


@dataclass(frozen=True)
class _System:
    """Normal equations: whole (6 F, 6 F) and right (F, 6) of the poses; inner (P, 3, 3) and pull
    (P, 3) of the points; joins (O, 6, 3)."""

    whole: np.ndarray
    right: np.ndarray
    inner: np.ndarray
    pull: np.ndarray
    joins: np.ndarray


def _bends(poses: Poses) -> np.ndarray:
    """Second differences (F - 2, 6) of poses."""
    steps = np.concatenate(
        [relative_vectors(poses.rotation), np.diff(poses.translation, axis=0)], axis=1
    )
    return np.diff(steps, axis=0)


def _summed(index: np.ndarray, count: int, values: np.ndarray) -> np.ndarray:
    """Sums (count, ...) of the values (O, ...) of each index."""
    out = np.zeros((count, *values.shape[1:]))
    np.add.at(out, index, values)
    return out


def _dense(diagonal: np.ndarray, beside: np.ndarray, further: np.ndarray) -> np.ndarray:
    """A symmetric matrix (6 F, 6 F) from its blocks on the diagonal and beside it."""
    frames = len(diagonal)
    out = np.zeros((frames, DOF, frames, DOF))
    every = np.arange(frames)
    out[every, :, every] = diagonal
    for offset, blocks in ((1, beside), (2, further)):
        for k in range(frames - offset):
            out[k, :, k + offset] += blocks[k]
            out[k + offset, :, k] += blocks[k].T
    return out.reshape(frames * DOF, frames * DOF)
