"""A face that is replaced in a frame."""

from dataclasses import dataclass

import numpy as np

from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.prepared import PreparedClip


@dataclass(frozen=True)
class Face:
    """A face in a frame of the film, the rendered head, and how much of it is shown.

    Attributes:
        beside: the heads of the frames before and after, where they are needed.
    """

    clip: PreparedClip
    film: FilmFrame
    head: np.ndarray
    share: float
    beside: tuple[np.ndarray | None, np.ndarray | None] = (None, None)
