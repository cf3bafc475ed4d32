"""The pattern of the mark in sums of a video: at one scale, window and shift, and at all of them.

Sums are sampled twice a cell and folded onto one tile of the pattern, and the tile is correlated
with the cells of each bit at every shift. T cells a side of the tile, B bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy import fft

from dubbing.provenance.mark import BITS, CELLS, FINE_CELLS, TILE, Code

STEP = 0.006  # between logarithms of scales, for the whole frame
# Parts of a frame in which the mark may lie: size, and first rows and columns, shares of the frame.
WINDOWS = {1.0: (0.0,), 0.5: (0.0, 0.25, 0.5), 0.34: (0.0, 0.165, 0.33, 0.495, 0.66)}
MIN_SCALE, MAX_SCALE = 0.85, 1.32  # size of a copy's cells, over that of an unscaled copy
REFINE = 12  # half steps of scale to either side, by which a match is refined
PHASES = 2  # samples a cell and direction
Window = tuple[float, float, float]  # row, column, size; shares of the frame
WHOLE: Window = (0.0, 0.0, 1.0)
GRIDS = (1.0, CELLS / FINE_CELLS)  # scales at which marks are drawn


@dataclass(frozen=True)
class Match:
    """S at one scale and window, at its best shift, with the 64 correlations there."""

    value: float = -1.0
    scale: float = 1.0
    window: Window = WHOLE
    scores: np.ndarray = field(default_factory=lambda: np.zeros(BITS))

    def __lt__(self, other: Match) -> bool:
        return self.value < other.value


def match_at(
    total: np.ndarray,
    spectra: np.ndarray,
    code: Code,
    scale: float,
    window: Window,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Match:
    """The match at a scale, in a window; ``shift``: of the samples, a share of their distance."""
    value, correlations = strongest(fold(total, scale, window, shift), spectra, code)
    return Match(value, scale, window, correlations)


def refine_match(total: np.ndarray, spectra: np.ndarray, code: Code, best: Match) -> Match:
    """The best match with scales and shifts between the searched ones and with other windows.

    It decides no more whether there is a mark, it only makes the bits surer.
    """
    for k in range(-REFINE, REFINE + 1):
        for window in {best.window, WHOLE}:
            scale = best.scale * math.exp(k * STEP / 2)
            best = max(best, match_at(total, spectra, code, scale, window))
    for window in {window for _, window in candidates()}:
        best = max(best, match_at(total, spectra, code, best.scale, window))
    for shift in ((0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        best = max(best, match_at(total, spectra, code, best.scale, best.window, shift))
    return best


def candidates() -> list[tuple[float, Window]]:
    """Scales and windows, the likeliest scales first; small windows need fewer scales."""
    first, last = math.log(MIN_SCALE), math.log(MAX_SCALE)
    logs = []
    for size, places in WINDOWS.items():
        step = STEP / size
        steps = range(math.floor(first / step), math.ceil(last / step) + 1)
        corners = [(row, column) for row in places for column in places]
        logs += [(k * step, (row, column, size)) for k in steps for row, column in corners]
    logs.sort(key=lambda candidate: abs(candidate[0]))
    return [(grid * math.exp(log), window) for log, window in logs for grid in GRIDS]


def fold(
    total: np.ndarray, scale: float, window: Window, shift: tuple[float, float] = (0.0, 0.0)
) -> np.ndarray:
    """A window of the sum, sampled twice a cell and folded onto one tile: (2, 2, T, T)."""
    height, width = total.shape
    row, column, size = window
    part = total[
        round(row * height) : round((row + size) * height),
        round(column * width) : round((column + size) * width),
    ]
    if not part.size:
        return np.zeros((PHASES, PHASES, TILE, TILE), np.float32)
    step = scale * min(height, width) / CELLS / PHASES
    rows, columns = (max(1, int((n - 1) / step)) for n in part.shape)
    side = PHASES * TILE
    down, across = (step * (0.5 + part_of) for part_of in shift)
    grid = np.array([[step, 0, across], [0, step, down]], np.float32)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    sampled = cv2.warpAffine(part, grid, (columns, rows), flags=flags)
    padded = np.zeros((-(-rows // side) * side, -(-columns // side) * side), np.float32)
    padded[:rows, :columns] = sampled
    tiled = padded.reshape(-1, side, padded.shape[1] // side, side).sum((0, 2))
    return np.ascontiguousarray(tiled.reshape(TILE, PHASES, TILE, PHASES).transpose(1, 3, 0, 2))


def templates(code: Code) -> np.ndarray:
    """Conjugate spectra (B, T, T // 2 + 1) of the signs of every bit's cells."""
    own = code.owners == np.arange(BITS)[:, None, None]
    spectra: np.ndarray = np.conj(fft.rfft2((own * code.signs).astype(np.float32)))
    return spectra


def template_of(code: Code, bits: np.ndarray) -> np.ndarray:
    """Conjugate spectrum (1, T, T // 2 + 1) of the signs of all cells, with these bits (B,)."""
    signs = code.signs * np.where(bits > 0, 1, -1)[code.owners]
    spectrum: np.ndarray = np.conj(fft.rfft2(signs.astype(np.float32)))
    return spectrum[None]


def strongest(folded: np.ndarray, spectra: np.ndarray, code: Code) -> tuple[float, np.ndarray]:
    """S of the best shift, and the 64 correlations there in standard deviations.

    Args:
        folded: see `fold`.
        spectra: `templates`, or `template_of` bits: the best shift is then the one that shows them.
    """
    best = (0.0, np.zeros(BITS))
    for phase in folded.reshape(-1, TILE, TILE):
        spread = float(np.mean(phase**2)) * (TILE * TILE // BITS)
        if spread <= 0:
            continue
        correlated = fft.irfft2(fft.rfft2(phase) * spectra, s=(TILE, TILE))
        rough = np.einsum("bij,bij->ij", correlated, correlated) / spread
        row, column = np.unravel_index(int(np.argmax(rough)), rough.shape)
        exact = scores(np.roll(phase, (-row, -column), (0, 1)), code)
        value = float(np.sum(exact**2))
        if value > best[0]:
            best = value, exact
    return best


def scores(tile: np.ndarray, code: Code) -> np.ndarray:
    """Correlation of every bit with a tile in place, over its standard deviation: (B,)."""
    owners = code.owners.ravel()
    sums = np.bincount(owners, (tile * code.signs).ravel(), BITS)
    squares = np.bincount(owners, (tile**2).ravel(), BITS)
    return sums / np.sqrt(np.maximum(squares, 1e-12))
