"""Finding the invisible mark in a video that was encoded, made smaller or cropped.

Sums of what changes in the luma (see `mark_sums`) are weighted by the wave for every beginning of
its period, folded onto one tile for every scale that is tried, and correlated with the cells of
each bit at every shift. Each of the 64 correlations, divided by its own standard deviation over all
keys, has mean 0 and at most the tail of a normal variable where there is no mark of this key, for
the signs of the cells are fair coins. So the sum S of their squares has at most the tail of chi
squared of 64 degrees, and Chernoff's bound times the number of places searched bounds how often a
mark is reported where there is none.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from dubbing.provenance.mark import BITS, TILE, Code
from dubbing.provenance.mark_match import (
    GRIDS,
    PHASES,
    WHOLE,
    Match,
    Window,
    candidates,
    match_at,
    refine_match,
    template_of,
    templates,
)
from dubbing.provenance.mark_sums import BINS, by_phase, pieces

FALSE_ALARMS = 1e-6  # for a whole search
SURE = 2.0  # times the threshold, beyond which the search ends
OVERTONE = 3  # of the wave, which slow motion in the image disturbs least
PIECES_TOGETHER = 4  # pieces of the sums that are also searched as one: faces come and go


@dataclass(frozen=True)
class MarkResult:
    """Result of the search for the mark of one key.

    Attributes:
        present: whether the mark of the key is there.
        statistic: S of the best place; about 64 where there is no mark.
        threshold: the least S at which a mark counts as present.
        bits: (64,) of 0 or 1.
        sureness: (64,) standard deviations that speak for each bit.
        scale: size of the cells in this video, over the size they would have if it was not scaled.
        frames: how many were read.
    """

    present: bool
    statistic: float
    threshold: float
    bits: np.ndarray
    sureness: np.ndarray
    scale: float
    frames: int


def search(
    frames: Iterable[np.ndarray],
    rate: Fraction,
    keys: Iterable[bytes],
    wanted: np.ndarray | None = None,
) -> list[MarkResult]:
    """Search luma frames (H, W) uint8, which are read once, for the marks of keys.

    First at the scales at which marks are drawn: in the whole video and in pieces of it, so that
    the seconds in which a face speaks do not drown in the rest. Then, in the whole video, at every
    scale, shift and window.

    Args:
        wanted: (64,) bits that all are to have: places are chosen by what shows them, which takes
            one correlation for 64; the search ends as soon as they are read, and does without
            the latter.
    """
    codes = [Code.of(key) for key in keys]
    searches = [Search(code, wanted) for code in codes]
    count, searched, last, whole = 0, 0, deque[np.ndarray](maxlen=PIECES_TOGETHER), None
    for bins, added in pieces(frames, rate):
        count, searched = count + added, searched + 1
        whole = bins if whole is None else whole + bins
        last.append(bins)
        for part in [bins, np.sum(last, 0)][: len(last)]:
            for one in searches:
                one.add(part)
        if wanted is not None:
            results = [one.result(limit_of(searched), count) for one in searches]
            if all(one.present and np.array_equal(one.bits, wanted) for one in results):
                return results
    limit = limit_of(searched)
    if whole is not None:
        for one in searches:
            one.add(whole)
            if wanted is None and one.best.value < limit:
                one.everywhere(whole, limit)
    return [one.result(limit, count) for one in searches]


def limit_of(searched: int) -> float:
    """Threshold of S for a search of so many pieces of the video."""
    places = 2 * len(candidates()) + len(GRIDS) * BINS * (2 * searched + 1)
    return threshold(FALSE_ALARMS / places / (PHASES * TILE) ** 2)


class Search:
    """The search for one key's mark, while sums come in."""

    def __init__(self, code: Code, wanted: np.ndarray | None) -> None:
        self._code = code
        self._spectra = templates(code) if wanted is None else template_of(code, wanted)
        self.best, self._bins = Match(), np.zeros((BINS, 0, 0), np.float32)

    def add(self, bins: np.ndarray) -> None:
        """Search sums (BINS, H, W) at the scales of drawn marks, for each beginning of the wave."""
        for total in by_phase(bins):
            for scale in GRIDS:
                match = self._match(total, scale, WHOLE)
                if self.best < match:
                    self.best, self._bins = match, bins

    def result(self, limit: float, frames: int) -> MarkResult:
        """The result of so many frames, with this threshold."""
        best = self._refined() if self.best.value >= limit else self.best
        return MarkResult(
            present=self.best.value >= limit,
            statistic=self.best.value,
            threshold=limit,
            bits=(best.scores > 0).astype(np.uint8),
            sureness=np.abs(best.scores),
            scale=best.scale,
            frames=frames,
        )

    def _match(self, total: np.ndarray, scale: float, window: Window) -> Match:
        return match_at(total, self._spectra, self._code, scale, window)

    def everywhere(self, whole: np.ndarray, limit: float) -> None:
        """Search the whole video at all scales, by one overtone of the wave wherever it begins."""
        angle = np.arange(BINS) * (2 * np.pi * OVERTONE / BINS)
        quarters = [np.tensordot(f(angle).astype(np.float32), whole, 1) for f in (np.cos, np.sin)]
        best = Match()
        for scale, window in candidates():
            best = max(best, *(self._match(part, scale, window) for part in quarters))
            if best.value > SURE * limit:
                break  # chance alone does not reach this
        matches = [self._match(total, best.scale, best.window) for total in by_phase(whole)]
        if self.best < max(matches):
            self.best, self._bins = max(matches), whole

    def _refined(self) -> Match:
        """The best match, refined for its bits."""
        totals = by_phase(self._bins)
        matches = [self._match(total, self.best.scale, self.best.window) for total in totals]
        best = max(matches)
        return refine_match(totals[matches.index(best)], self._spectra, self._code, best)


def threshold(chance: float) -> float:
    """Value that chi squared of 64 degrees exceeds with at most this chance (Chernoff's bound)."""
    low, high = float(BITS), 100.0 * BITS
    for _ in range(60):
        middle = (low + high) / 2
        log = -(middle - BITS) / 2 + BITS / 2 * math.log(middle / BITS)
        low, high = (middle, high) if log > math.log(chance) else (low, middle)
    return high
