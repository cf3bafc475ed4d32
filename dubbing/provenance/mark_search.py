"""Finding the invisible mark in a video that was encoded, made smaller or cropped.

Sums of what changes in the luma (see `mark_sums`) are weighted by the wave for every beginning of
its period, folded onto one tile for every scale that is tried, and correlated with the cells of
each bit at every shift. Each of the 64 correlations, divided by its own standard deviation over all
keys, has mean 0 and at most the tail of a normal variable where there is no mark of this key, for
the signs of the cells are fair coins. So the sum S of their squares has at most the tail of chi
squared of 64 degrees, and Chernoff's bound times the number of places looked at bounds how often a
mark is seen where none is.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from dubbing.provenance.mark import BITS, TILE, Code
from dubbing.provenance.mark_sight import (
    GRIDS,
    PHASES,
    WHOLE,
    Sight,
    Window,
    look,
    nearer,
    templates,
    tries,
)
from dubbing.provenance.mark_sums import BINS, by_phase, pieces

FALSE_ALARMS = 1e-6  # for a whole search
SURE = 2.0  # times the threshold, beyond which the search ends
OVERTONE = 3  # of the wave, which slow motion of the picture disturbs least
SEVERAL = 4  # pieces of the sums that are looked at together: faces come and go


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
        frames: how many were looked at.
    """

    present: bool
    statistic: float
    threshold: float
    bits: np.ndarray
    sureness: np.ndarray
    scale: float
    frames: int


def search(
    frames: Iterable[np.ndarray], rate: Fraction, keys: Iterable[bytes], everywhere: bool = True
) -> list[Found]:
    """Look for the marks of keys in luma frames (H, W) uint8, which are read once.

    First where it was drawn, in all of the video and, lest seconds in which a face speaks drown in
    the rest, in pieces of it; then, in all of the video, at every scale, shift and window.

    Args:
        everywhere: whether to do the latter; if not, the search ends as soon as all are found.
    """
    codes = [Code.of(key) for key in keys]
    searches = [Search(code) for code in codes]
    count, looks, last, whole = 0, 0, deque[np.ndarray](maxlen=SEVERAL), None
    for bins, added in pieces(frames, rate):
        count, looks = count + added, looks + 1
        whole = bins if whole is None else whole + bins
        last.append(bins)
        for part in [bins, np.sum(last, 0)][: len(last)]:
            for one in searches:
                one.glance(part)
        if not everywhere and all(one.best.value > SURE * limit_of(looks) for one in searches):
            break
    return [one.end(whole, limit_of(looks), count, everywhere) for one in searches]


def limit_of(looks: int) -> float:
    """Threshold of S for a search that looked so often at pieces of the video."""
    places = 2 * len(tries()) + len(GRIDS) * BINS * (2 * looks + 1)
    return threshold(FALSE_ALARMS / places / (PHASES * TILE) ** 2)


class Search:
    """The search for one key's mark, while sums come in."""

    def __init__(self, code: Code) -> None:
        self._code, self._spectra = code, templates(code)
        self.best, self._bins = Sight(), np.zeros((BINS, 0, 0), np.float32)

    def glance(self, bins: np.ndarray) -> None:
        """Look at sums (BINS, H, W) where the mark was drawn, for each beginning of the wave."""
        for total in by_phase(bins):
            for scale in GRIDS:
                seen = self._look(total, scale, WHOLE)
                if self.best < seen:
                    self.best, self._bins = seen, bins

    def end(self, whole: np.ndarray | None, limit: float, frames: int, everywhere: bool) -> Found:
        """End the search with a look at the sums of the whole video."""
        if whole is not None:
            self.glance(whole)
            if everywhere and self.best.value < limit:
                self._everywhere(whole, limit)
        best = self._sharpened() if self.best.value >= limit else self.best
        return Found(
            present=self.best.value >= limit,
            statistic=self.best.value,
            threshold=limit,
            bits=(best.scores > 0).astype(np.uint8),
            sureness=np.abs(best.scores),
            scale=best.scale,
            frames=frames,
        )

    def _look(self, total: np.ndarray, scale: float, window: Window) -> Sight:
        return look(total, self._spectra, self._code, scale, window)

    def _everywhere(self, whole: np.ndarray, limit: float) -> None:
        """Look at all scales and windows, by one overtone of the wave wherever it begins."""
        angle = np.arange(BINS) * (2 * np.pi * OVERTONE / BINS)
        quarters = [np.tensordot(f(angle).astype(np.float32), whole, 1) for f in (np.cos, np.sin)]
        places = Sight()
        for scale, window in tries():
            places = max(places, *(self._look(part, scale, window) for part in quarters))
            if places.value > SURE * limit:
                break  # no chance finds more
        seen = [self._look(total, places.scale, places.window) for total in by_phase(whole)]
        if self.best < max(seen):
            self.best, self._bins = max(seen), whole

    def _sharpened(self) -> Sight:
        """The sight made sharper, for its bits."""
        totals = by_phase(self._bins)
        seen = [self._look(total, self.best.scale, self.best.window) for total in totals]
        return nearer(totals[seen.index(max(seen))], self._spectra, self._code, max(seen))


def threshold(chance: float) -> float:
    """What chi squared of 64 degrees exceeds with at most this chance, by Chernoff's bound."""
    low, high = float(BITS), 100.0 * BITS
    for _ in range(60):
        middle = (low + high) / 2
        log = -(middle - BITS) / 2 + BITS / 2 * math.log(middle / BITS)
        low, high = (middle, high) if log > math.log(chance) else (low, middle)
    return high
