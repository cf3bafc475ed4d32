"""Motion of a mouth: whether it moves in speech, and rests in silence.

Letters: F frames, M mouth points.
"""

from dataclasses import dataclass, field

import numpy as np

from dubbing.face.mouth_shape import opening
from dubbing.sync.result import Motion

# Opening range of a mouth that moves, in distances between the outer corners of the eyes; a
# still one measures below a quarter of this (docs/development/sync.md).
MOVING_RANGE = 0.03
# The mouth moves in silence if it is this fast there, as a share of its speed in speech.
SILENT_SHARE = 0.6
# A frame is silent without voice for this long before and after, so that closing lips do not count.
SILENT_MARGIN = 0.3
MIN_SILENCE = 1.0
MIN_SPEECH = 1.0
BINS = 400
WIDEST = 1.0


def silent_frames(voice: np.ndarray, rate: float) -> np.ndarray:
    """Frames (F,) bool without voice (F,) from 0.3 s before to 0.3 s after."""
    reach = max(1, round(SILENT_MARGIN * rate))
    padded = np.pad(voice, reach, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return around.max(1) == 0


@dataclass
class MotionSum:
    """Mouth motion of one face, summed block by block: histogram of the opening, speeds."""

    rate: float
    histogram: np.ndarray = field(default_factory=lambda: np.zeros(BINS))
    speed: dict[bool, float] = field(default_factory=lambda: {True: 0.0, False: 0.0})
    frames: dict[bool, int] = field(default_factory=lambda: {True: 0, False: 0})

    def add(self, shapes: np.ndarray, voice: np.ndarray) -> None:
        """Shapes (F, M, 2), NaN without a face; voice activity (F,)."""
        height = opening(shapes)
        # Over three frames: landmarks jitter from frame to frame, mouths move more slowly.
        smooth = height.copy()
        smooth[1:-1] = (height[:-2] + height[1:-1] + height[2:]) / 3
        known = smooth[np.isfinite(smooth)]
        bins = np.clip((known / WIDEST * BINS).astype(int), 0, BINS - 1)
        self.histogram += np.bincount(bins, minlength=BINS)
        pace = np.abs(np.diff(smooth)) * self.rate
        silent = silent_frames(voice, self.rate)[1:]
        for quiet in (True, False):
            chosen = pace[(silent == quiet) & np.isfinite(pace)]
            self.speed[quiet] += float(chosen.sum())
            self.frames[quiet] += len(chosen)

    def result(self) -> Motion:
        count = self.histogram.sum()
        share = np.cumsum(self.histogram) / max(count, 1)
        low, high = (int(np.searchsorted(share, q)) for q in (0.05, 0.95))
        opening_range = (high - low) * WIDEST / BINS if count else 0.0
        silence = self._mean_speed(True, MIN_SILENCE)
        speech = self._mean_speed(False, MIN_SPEECH)
        restless = None
        if silence is not None and speech is not None:
            restless = silence > SILENT_SHARE * speech
        moves = opening_range >= MOVING_RANGE
        return Motion(opening_range, moves, restless, speech, silence)

    def _mean_speed(self, quiet: bool, seconds: float) -> float | None:
        frames = self.frames[quiet]
        return self.speed[quiet] / frames if frames >= seconds * self.rate else None
