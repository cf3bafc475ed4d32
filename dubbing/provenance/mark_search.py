"""Finding the invisible mark in a video that was encoded, made smaller or cropped.

What of the luma stands out from its surroundings is added up over frames: the mark stands still, so
every frame votes. The sum is folded onto one tile for every scale that is tried, and correlated
with the cells of each bit at every shift. Each of the 64 correlations, divided by its own standard
deviation over all keys, has mean 0 and at most the tail of a normal variable where there is no
mark of this key, for the signs of the cells are fair coins. So the sum S of their squares has at
most the tail of chi squared of 64 degrees, and Chernoff's bound times the number of places looked
at bounds how often a mark is seen where none is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy import fft

from dubbing.provenance.mark import BITS, CELLS, TILE, Code

FALSE_ALARMS = 1e-6  # for a whole search
STEP = 0.006  # between logarithms of scales, for the whole frame
# Parts of a frame in which the mark may lie: size, and first rows and columns, shares of the frame.
WINDOWS = {1.0: (0.0,), 0.5: (0.0, 0.25, 0.5), 0.34: (0.0, 0.165, 0.33, 0.495, 0.66)}
SMALLEST, LARGEST = 0.85, 1.32  # cells of a copy, of what its size would have them
FINEST = 720  # px of the shorter side; larger frames are made as small first
LOUDEST = 3.0  # deviations; what a pixel counts at most
SURE = 2.0  # times the threshold, beyond which the search ends
REFINE = 12  # half steps of scale to either side, to see a mark that was found more sharply
PHASES = 2  # samples a cell and direction

Window = tuple[float, float, float]  # row, column, size; shares of the frame


@dataclass(frozen=True)
class Found:
    """What a search came to.

    Attributes:
        present: whether the mark of the key is there.
        statistic: S of the best place; about 64 where there is no mark.
        threshold: what S must reach.
        bits: (64,) of 0 or 1.
        sureness: (64,) standard deviations that speak for each bit.
        scale: cells of this video, of what its size would have them.
        frames: how many were added up.
    """

    present: bool
    statistic: float
    threshold: float
    bits: np.ndarray
    sureness: np.ndarray
    scale: float
    frames: int


def summed(frames: Iterable[np.ndarray]) -> tuple[np.ndarray, int]:
    """What stands out of luma frames (H, W) uint8, added up, and how many there were.

    (H, W) float32; larger frames are made smaller, see `FINEST`.
    """
    total: np.ndarray | None = None
    count = 0
    for frame in frames:
        out = standing_out(frame)
        total = out if total is None else total + out
        count += 1
    return (np.zeros((0, 0), np.float32) if total is None else total), count


def standing_out(frame: np.ndarray) -> np.ndarray:
    """Luma (H, W) against its surroundings, in their deviations."""
    side = min(frame.shape)
    if side > FINEST:
        size = (round(frame.shape[1] * FINEST / side), round(frame.shape[0] * FINEST / side))
        frame = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    luma = frame.astype(np.float32)
    cell = min(luma.shape) / CELLS
    fine = cv2.GaussianBlur(luma, (0, 0), max(0.3, 0.35 * cell))
    wide = cv2.GaussianBlur(luma, (0, 0), 1.2 * cell)
    out = fine - wide
    out /= np.maximum(deviation(out, 4 * cell), 0.35)
    return np.clip(out, -LOUDEST, LOUDEST)


def deviation(picture: np.ndarray, radius: float) -> np.ndarray:
    """Standard deviation of a picture (h, w) float32 in the square of ``radius`` round a pixel."""
    side = 2 * max(1, round(radius)) + 1
    mean = cv2.blur(picture, (side, side))
    square = cv2.blur(picture * picture, (side, side))
    return np.sqrt(np.maximum(square - mean * mean, 0))


def search(total: np.ndarray, frames: int, key: bytes) -> Found:
    """Look for the mark of a key at all scales, shifts and windows."""
    code = Code.of(key)
    spectra = templates(code)
    tried = tries()
    limit = threshold(FALSE_ALARMS / len(tried) / (PHASES * TILE) ** 2)
    best = Sight()
    for scale, window in tried:
        best = max(best, look(total, spectra, code, scale, window))
        if best.value > SURE * limit:
            break  # no chance finds more
    seen = nearer(total, spectra, code, best) if best.value >= limit else best
    return Found(
        present=best.value >= limit,
        statistic=best.value,
        threshold=limit,
        bits=(seen.scores > 0).astype(np.uint8),
        sureness=np.abs(seen.scores),
        scale=seen.scale,
        frames=frames,
    )


@dataclass(frozen=True)
class Sight:
    """S at one scale and window, at its best shift, with the 64 correlations there."""

    value: float = -1.0
    scale: float = 1.0
    window: Window = (0.0, 0.0, 1.0)
    scores: np.ndarray = field(default_factory=lambda: np.zeros(BITS))

    def __lt__(self, other: Sight) -> bool:
        return self.value < other.value


def look(
    total: np.ndarray,
    spectra: np.ndarray,
    code: Code,
    scale: float,
    window: Window,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Sight:
    """What is seen at a scale, in a window; ``shift``: of the samples, of their distance."""
    value, found = strongest(fold(total, scale, window, shift), spectra, code)
    return Sight(value, scale, window, found)


def nearer(total: np.ndarray, spectra: np.ndarray, code: Code, best: Sight) -> Sight:
    """A sight made sharper: by scales between, other windows and shifts between. For the bits."""
    for k in range(-REFINE, REFINE + 1):
        for window in {best.window, (0.0, 0.0, 1.0)}:
            scale = best.scale * math.exp(k * STEP / 2)
            best = max(best, look(total, spectra, code, scale, window))
    for window in {window for _, window in tries()}:
        best = max(best, look(total, spectra, code, best.scale, window))
    for shift in ((0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        best = max(best, look(total, spectra, code, best.scale, best.window, shift))
    return best


def tries() -> list[tuple[float, Window]]:
    """Scales and windows, the likeliest scales first; small windows need fewer scales."""
    first, last = math.log(SMALLEST), math.log(LARGEST)
    found = []
    for size, places in WINDOWS.items():
        step = STEP / size
        steps = range(math.floor(first / step), math.ceil(last / step) + 1)
        corners = [(row, column) for row in places for column in places]
        found += [(k * step, (row, column, size)) for k in steps for row, column in corners]
    return [(math.exp(log), window) for log, window in sorted(found, key=lambda t: abs(t[0]))]


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


def strongest(folded: np.ndarray, spectra: np.ndarray, code: Code) -> tuple[float, np.ndarray]:
    """S of the best shift, and the 64 correlations there in standard deviations."""
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


def threshold(chance: float) -> float:
    """What chi squared of 64 degrees exceeds with at most this chance, by Chernoff's bound."""
    low, high = float(BITS), 100.0 * BITS
    for _ in range(60):
        middle = (low + high) / 2
        log = -(middle - BITS) / 2 + BITS / 2 * math.log(middle / BITS)
        low, high = (middle, high) if log > math.log(chance) else (low, middle)
    return high
