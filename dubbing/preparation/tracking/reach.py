"""The share of some frames that is dubbed, or can be; at which angles, and why the rest is not.

T frames. Angles are in degrees: yaw is positive where the head turns to the right of the picture,
pitch where it looks up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

USUAL = (5, 95)  # percentiles of the range of angles
ENOUGH = 0.95  # share of the frames; a line with less gets a warning
NOT_SEEN = ("", "no face", "covered")  # reasons that preparation knows, by their numbers


@dataclass(frozen=True)
class Angles:
    """Angles of the frames that show a face: their usual range, and the one farthest from 0."""

    low: float
    high: float
    most: float

    def in_words(self, minus: str, plus: str) -> str:
        """As ``10 to 42 degrees right (48 right at most)``, with names of the two sides."""
        low, high, most = (round(angle) for angle in (self.low, self.high, self.most))
        near, far = sorted((abs(low), abs(high)))
        side = plus if high > 0 else minus if low < 0 else ""
        if low < 0 < high:
            words = f"{-low} degrees {minus} to {high} {plus}"
        elif near < far:
            words = f"{near} to {far} degrees {side}"
        else:
            words = f"{far} degrees {side}".rstrip()
        beyond = f" ({abs(most)} {plus if most > 0 else minus} at most)"
        return words if low <= most <= high else words + beyond


@dataclass(frozen=True)
class Reach:
    """How much of some frames is dubbed.

    Attributes:
        frames: all of them. dubbed: those whose face is replaced, or can be.
        overlaid: of these, those in which something lies over the face.
        reasons: why the others are not dubbed, each with its number of frames.
        yaw, pitch: None where no frame shows a face.
    """

    frames: int
    dubbed: int
    overlaid: int
    reasons: dict[str, int]
    yaw: Angles | None
    pitch: Angles | None

    @property
    def share(self) -> float:
        """Share of the frames that is dubbed."""
        return self.dubbed / self.frames if self.frames else 0.0

    @property
    def short(self) -> bool:
        """Whether so little is dubbed that it is worth a warning."""
        return self.share < ENOUGH

    def turned(self) -> str:
        """The range of yaw in words; empty where no frame shows a face."""
        return self.yaw.in_words("left", "right") if self.yaw else ""

    def tilted(self) -> str:
        """The range of pitch in words; empty where no frame shows a face."""
        return self.pitch.in_words("down", "up") if self.pitch else ""

    def why_not(self) -> str:
        """The reasons why frames are not dubbed, in words: ``no face in 12 frames, covered in 3``.

        Empty where all are dubbed.
        """
        parts = [f"{reason} in {count}" for reason, count in self.reasons.items()]
        if parts:
            parts[0] += " frame" if parts[0].endswith(" in 1") else " frames"
        return ", ".join(parts)

    def in_words(self, what: str = "dubbed") -> str:
        """A sentence; ``what`` the counted frames are, or do."""
        left = self.frames - self.dubbed
        percent = 100 * self.dubbed // max(self.frames, 1)  # 100 of all of them alone
        words = f"{percent} % of the frames {what}" if left else f"all frames {what}"
        if self.yaw:
            words += f", head turned {self.turned()}, tilted {self.tilted()}"
        if left:
            words += f"; {100 - percent} % not: {self.why_not()}"
        if self.overlaid:
            words += f"; something lies over the face in {_percent(self.overlaid, self.frames)}"
        return words


def reach_of(
    views: np.ndarray,
    valid: np.ndarray,
    over: np.ndarray,
    kept: np.ndarray,
    names: Sequence[str] = NOT_SEEN,
) -> Reach:
    """The reach of some frames.

    Args:
        views: (T, 3); see `views_of`. valid: (T,) a face was found.
        over: (T,) something lies over the face.
        kept: (T,) number of the reason why the face is not replaced; 0: it is.
        names: of the reasons, by their numbers.
    """
    yaw, pitch = (_usual(angle[valid]) for angle in angles_of(views))
    counts = {name: int((kept == number).sum()) for number, name in enumerate(names) if number}
    return Reach(
        frames=len(kept),
        dubbed=int((kept == 0).sum()),
        overlaid=int((over & (kept == 0)).sum()),
        reasons={name: count for name, count in counts.items() if count},
        yaw=yaw,
        pitch=pitch,
    )


def hidden(valid: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Numbers (T,) of the reasons, of `NOT_SEEN`, why frames do not show a face; 0: they do."""
    return np.select([~valid, covered], [1, 2], 0)


def views_of(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Unit vectors (T, 3) from heads to the camera, in the head frame, of poses of heads."""
    away = -np.einsum("tji,tj->ti", rotation, translation)
    return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))


def angles_of(views: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Yaw and pitch (T,) of a head that is seen from unit vectors (T, 3)."""
    x, y, z = views.T
    return np.rad2deg(np.arctan2(-x, -z)), np.rad2deg(np.arcsin(np.clip(y, -1, 1)))


def _usual(angle: np.ndarray) -> Angles | None:
    if not len(angle):
        return None
    low, high = np.percentile(angle, USUAL)
    most = angle[np.abs(angle).argmax()]
    return Angles(*(round(float(value), 1) for value in (low, high, most)))


def _percent(part: int, whole: int) -> str:
    """A share of frames that are not none: never 0 %."""
    return f"{max(1, round(100 * part / whole))} %"
