"""The sound of a file in blocks, for readers that go through it several times."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from dubbing.media.reading.reading import iter_audio

KEPT_S = 60.0  # of sound: a line is decoded once, as that takes longer than to hear it


def sound_blocks(
    path: Path | str, *, rate: int = 16000, start: float = 0.0, seconds: float | None = None
) -> Callable[[], Iterable[np.ndarray]]:
    """Gives the blocks of `iter_audio` as often as it is called.

    Sound of at most `KEPT_S` is decoded once and kept.
    """

    def decoded() -> Iterable[np.ndarray]:
        return iter_audio(path, rate=rate, start=start, seconds=seconds)

    if seconds is None or seconds > KEPT_S:
        return decoded
    return functools.cache(lambda: list(decoded()))
