"""The constant frame rate that the time stamps of a video follow."""

import itertools
import statistics
from collections.abc import Sequence
from fractions import Fraction

COMMON_RATES = (
    *(Fraction(n) for n in (10, 12, 15, 20, 24, 25, 30, 48, 50, 60, 90, 100, 120, 200, 240)),
    *(Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 120, 240)),
)
JITTER = 0.3  # largest departure of a time stamp from a constant rate, in frames


def choose_rate(times: Sequence[float], hints: Sequence[Fraction]) -> tuple[Fraction, bool]:
    """The constant frame rate that sorted time stamps (seconds) follow, and whether they vary.

    The last of several is later than the first.

    Constant: the first of the snapped hints, the hints and the snapped mean for which every time
    stamp is within ``JITTER`` frames. Variable: the common rate nearest to the most frequent
    interval, so that a video with dropped frames keeps the rate it was filmed at.
    """
    if len(times) < 2:
        return (hints[0] if hints else Fraction(25)), False
    pace = (len(times) - 1) / (times[-1] - times[0])
    mean = Fraction(pace).limit_denominator(1001)
    candidates = [snap(hint) for hint in hints] + list(hints) + [snap(mean), mean]
    for rate in candidates:
        if all(abs((t - times[0]) * rate - k) < JITTER for k, t in enumerate(times)):
            return rate, False
    intervals = [b - a for a, b in itertools.pairwise(times)]
    median = statistics.median(intervals)
    # Their mean, because time stamps in whole milliseconds make 33 and 34 of 1/30 s.
    regular = [interval for interval in intervals if abs(interval - median) < 0.5 * median]
    typical = 1 / statistics.fmean(regular) if median > 0 else pace
    return min(COMMON_RATES, key=lambda r: max(r / typical, typical / r)), True


def snap(rate: Fraction) -> Fraction:
    """The common rate that a rate is next to; itself where there is none."""
    nearest = min(COMMON_RATES, key=lambda common: abs(common - rate))
    return nearest if abs(nearest - rate) < Fraction(3, 10000) * rate else rate
