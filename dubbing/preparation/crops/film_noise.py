"""Noise of a film, from how its frames differ: grain, or what a sensor adds.

Blocks of `BLOCK` x `BLOCK` px that hold nothing but an even surface differ from frame to frame by
noise alone, whether the camera stands or moves. They are those that differ least. T frames.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

BLOCK = 8
PAIRS = 30  # of frames that are measured in a shot, spread over it
LOW, HIGH = 5.0, 30.0  # percent: blocks whose differences are taken for noise
QUANTILE, ITS_VALUE = 15.0, 0.86  # percent of the blocks, and the variance there, of the noise's
LIKE_SKIN = 0.4  # share of the face's brightness that a block may be off: noise depends on it
FACE = (0.35, 0.65)  # of the window's sides: surely face
LEAST_BLOCKS = 20
ROWS = 48  # of blocks that are enough
NUMBERS = 5
GOES_ON = 0.5  # correlation of neighbouring blocks' lines, from which on they are lines of the film
MOST = 3.0  # median deviations of a line that count: things that move differ by more
CHANNELS = ((0, 1), (0, 2), (1, 2))  # pairs of them


class NoiseMeter:
    """Measures the noise in the windows of a film's frames, given one after the other.

    Args:
        segment: (T,) number of the shot. cut: the window of frame t, (side, side, 3), of an image.
    """

    def __init__(self, segment: np.ndarray, cut: Callable[[np.ndarray, int], np.ndarray]) -> None:
        self._segment, self._cut = segment, cut
        self._firsts = {t for shot in np.unique(segment) for t in pairs(segment == shot)}
        self._before: np.ndarray | None = None
        self._found: dict[int, list[np.ndarray]] = {}

    def add(self, t: int, image: np.ndarray) -> None:
        """Frame t of the film, (H, W, 3) uint8."""
        if self._before is not None:
            found = measured(self._cut(self._before, t), self._cut(image, t))
            if found is not None:
                self._found.setdefault(int(self._segment[t]), []).append(found)
        self._before = image if t in self._firsts else None

    def noise(self) -> np.ndarray:
        """Noise of every frame, (T, NUMBERS) float32, that of its shot; see `measured`."""
        out = np.zeros((len(self._segment), NUMBERS), np.float32)
        for shot, found in self._found.items():
            out[self._segment == shot] = np.median(found, 0)
        return out


def pairs(shot: np.ndarray) -> list[int]:
    """First frames of the pairs that are measured in a shot (T,) bool."""
    firsts = np.flatnonzero(shot)[:-1]
    some = np.linspace(0, len(firsts) - 1, min(PAIRS, len(firsts))).round().astype(int)
    return [int(t) for t in firsts[some]]


def measured(before: np.ndarray, after: np.ndarray) -> np.ndarray | None:
    """Noise of two frames in a row, (S, S, 3) uint8 both: standard deviations of R, G, B in levels,
    correlation of the channels, and of neighbouring pixels. None where too little is even."""
    side = len(before) // BLOCK * BLOCK
    low, high = (int(share * side) for share in FACE)
    brightness = float(after[low:high, low:high].mean())
    before, after = (some_rows(image[:side, :side]) for image in (before, after))
    like_skin = np.abs(block_means(after).mean(-1) - brightness) < LIKE_SKIN * brightness
    if like_skin.sum() < LEAST_BLOCKS:
        return None
    apart = without_lines(cv2.subtract(after, before, dtype=cv2.CV_32F))
    grey = cv2.transform(apart, np.full((1, 3), 1 / 3, np.float32))
    variance = block_means(grey * grey) - block_means(grey) ** 2
    least, most, typical = np.percentile(variance[like_skin], [LOW, HIGH, QUANTILE])
    even = like_skin & (variance >= least) & (variance <= most)
    down, right = even.shape
    chosen = apart.reshape(down, BLOCK, right, BLOCK, 3).swapaxes(1, 2)[even]
    chosen = chosen - chosen.mean((1, 2), keepdims=True)
    luma = float(chosen.mean(-1).var())
    if luma <= 0:
        return np.zeros(NUMBERS)
    own = chosen.var((0, 1, 2)) * typical / ITS_VALUE / luma / 2
    shared = np.mean([correlation(chosen[..., a], chosen[..., b]) for a, b in CHANNELS])
    pairs = [(chosen[:, :, 1:], chosen[:, :, :-1]), (chosen[:, 1:], chosen[:, :-1])]
    beside = np.mean([correlation(a, b) for a, b in pairs])
    return np.array([*np.sqrt(own), np.clip(shared, 0, 1), np.clip(beside, 0, 0.95)])


def without_lines(apart: np.ndarray) -> np.ndarray:
    """Differences of two frames (H, W, 3) less the lines that go on from block to block.

    The scan lines of a filmed screen and the bands of a lamp differ from frame to frame, and are no
    noise. Rows and columns are asked one after the other.
    """
    for axis in (0, 1):
        lines = apart.swapaxes(0, axis)
        blocks = lines.reshape(-1, BLOCK, lines.shape[1] // BLOCK, BLOCK, 3)
        means = blocks.mean(3, keepdims=True)
        means = means - means.mean(1, keepdims=True)
        grey = means[..., 0, :].mean(-1)
        grey = np.clip(grey, *(MOST * np.median(np.abs(grey)) * np.array([-1, 1])))
        if correlation(grey[:, :, 1:], grey[:, :, :-1]) > GOES_ON:
            # What is subtracted holds an eighth of the noise, too.
            rest = (blocks - means) * ((BLOCK + 1) / BLOCK) ** 0.5
            apart = rest.reshape(lines.shape).swapaxes(0, axis)
    return np.ascontiguousarray(apart)


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Correlation of two arrays of one shape; 0 where one of them does not change."""
    spread = float(one.std() * other.std())
    return float(np.mean((one - one.mean()) * (other - other.mean()))) / spread if spread else 0.0


def some_rows(image: np.ndarray) -> np.ndarray:
    """Rows of blocks of an image (S, S, 3) that are enough to measure: (H, S, 3)."""
    rows = image.reshape(-1, BLOCK, *image.shape[1:])
    return rows[:: max(1, len(rows) // ROWS)].reshape(-1, *image.shape[1:])


def block_means(image: np.ndarray) -> np.ndarray:
    """Means (H / BLOCK, W / BLOCK[, C]) float32 of the blocks of an image (H, W[, C])."""
    size = image.shape[1] // BLOCK, image.shape[0] // BLOCK
    return cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA)
