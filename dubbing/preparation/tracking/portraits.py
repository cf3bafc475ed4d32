"""A clip that shows a person, by which they are recognised among others."""

from dataclasses import dataclass
from pathlib import Path

# A point inside a face: seconds, and shares of the frame's width and height.
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Portrait:
    """A clip that shows a person at these points; without any, as its largest face."""

    clip: Path
    points: tuple[Point, ...] = ()
