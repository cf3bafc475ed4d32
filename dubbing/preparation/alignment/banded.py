"""Normal equations of a chain of 6-vectors, each coupled with its two neighbours.

T frames with 6 unknowns each. Poses that are smoothed by their second differences give a symmetric
matrix with three block diagonals: a band of 18 rows, solved in time linear in T.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

DOF = 6
BAND = 3 * DOF
HUBER = 1.345


@dataclass(frozen=True)
class NormalEquations:
    """diagonal (T, 6, 6) and right-hand side (T, 6) of one Gauss-Newton step of the poses."""

    diagonal: np.ndarray
    right: np.ndarray


def huber_weight(distance: np.ndarray) -> np.ndarray:
    """Weights of iteratively reweighted least squares for distances in sigmas."""
    return np.minimum(1.0, HUBER / np.maximum(distance, 1e-12))


def lower_band(diagonal: np.ndarray, next_one: np.ndarray, next_two: np.ndarray) -> np.ndarray:
    """LAPACK's lower band storage, (18, 6 T), of a block matrix.

    Args:
        diagonal: (T, 6, 6) symmetric blocks (t, t).
        next_one: (T - 1, 6, 6) blocks (t + 1, t).
        next_two: (T - 2, 6, 6) blocks (t + 2, t).
    """
    frames = len(diagonal)
    band = np.zeros((BAND, DOF * frames))
    for offset, blocks in enumerate((diagonal, next_one, next_two)):
        for column in range(DOF):
            for row in range(DOF):
                depth = offset * DOF + row - column
                if depth >= 0:
                    band[depth, column : DOF * len(blocks) : DOF] = blocks[:, row, column]
    return band


def solve_band(band: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve A x = right for a positive definite A in lower band storage; right (6 T,) or (6 T, K).

    Raises:
        numpy.linalg.LinAlgError: A is not positive definite.
    """
    return np.asarray(solveh_banded(band, right, lower=True, check_finite=False))


def second_difference_links(
    segment: np.ndarray, usable: np.ndarray, repeated: np.ndarray
) -> np.ndarray:
    """Middles t of the triples (t - 1, t, t + 1) that smoothness may join, as (T,) bool.

    A triple within one segment (no cut inside) of usable frames, none of which shows the one
    before it again: a conversion from 25 to 30 frames a second repeats every sixth, and motion
    that stops for a frame is not smooth.
    """
    linked = np.zeros(len(segment), bool)
    if len(segment) > 2:
        same = (segment[:-2] == segment[1:-1]) & (segment[1:-1] == segment[2:])
        moving = ~repeated[1:-1] & ~repeated[2:]
        linked[1:-1] = same & moving & usable[:-2] & usable[1:-1] & usable[2:]
    return linked


def smoothness_blocks(
    linked: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Blocks of sum_t w |x_{t-1} - 2 x_t + x_{t+1}|^2 over the linked t.

    Args:
        linked: (T,) bool, the middles of the triples.
        weight: (6,) inverse variances.

    Returns:
        Blocks for :func:`lower_band`.
    """
    frames = len(linked)
    one = np.zeros(frames)
    off1, off2 = np.zeros(max(frames - 1, 0)), np.zeros(max(frames - 2, 0))
    middle = np.flatnonzero(linked)
    for shift, factor in ((-1, 1.0), (0, 4.0), (1, 1.0)):
        np.add.at(one, middle + shift, factor)
    np.add.at(off1, middle - 1, -2.0)
    np.add.at(off1, middle, -2.0)
    np.add.at(off2, middle - 1, 1.0)
    eye = np.diag(weight)
    return one[:, None, None] * eye, off1[:, None, None] * eye, off2[:, None, None] * eye


def solve_bordered(
    band: np.ndarray, border: np.ndarray, corner: np.ndarray, right: np.ndarray, low: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve [[A, B], [B^T, C]] [x, y] = [right, low] by the Schur complement of A.

    Args:
        band: A in lower band storage, (18, 6 T). border: B, (6 T, K). corner: C, (K, K).
        right: (6 T,). low: (K,).

    Returns:
        x (6 T,) and y (K,).
    """
    solved = solve_band(band, np.concatenate((border, right[:, None]), axis=1))
    by_border, alone = solved[:, :-1], solved[:, -1]
    y = np.linalg.solve(corner - border.T @ by_border, low - border.T @ alone)
    return alone - by_border @ y, y
