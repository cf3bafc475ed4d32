"""Changes between frames of a video, added up by the mark's period.

The mark changes with time: content that stands still is removed, and the rest is divided by the
standard deviation of its surroundings, so that a cut or a hand weighs no more than skin. Frames
are added up separately for each of the BINS parts of the period, for where the period begins in a
part of a film is not known.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Self

import cv2
import numpy as np

from dfrf.ordered import ordered
from dubbing.provenance.mark import CELLS, PERIOD, WAVE

MAX_SIDE = 720  # px of the shorter side; larger frames are scaled down to it
MAX_CHANGE = 3.0  # deviations that a pixel counts at most
MIN_DEVIATION = 0.1  # grey levels; a smaller deviation counts as this much
BINS = 2 * len(WAVE)  # parts of the period
APART = 0.08  # seconds before and after a frame that it is compared with
FLOW_SIDE, MIN_FLOW_SIDE = 360, 32  # px of the shorter side: flow is computed at, and needs
PIECE = 2.0  # seconds that are added up by themselves
NOTHING = np.zeros(0, np.float32)  # in place of a second map
THREADS = max(1, min(8, os.cpu_count() or 1))


@dataclass(frozen=True)
class Luma:
    """A frame: values (H, W) float32, and a copy (h, w) uint8 at the size of flow."""

    values: np.ndarray
    small: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> Self:
        """The frame of these values."""
        share = _share(*values.shape)
        height, width = (max(1, round(side * share)) for side in values.shape)
        small = cv2.resize(values, (width, height), interpolation=cv2.INTER_AREA)
        return cls(values, small.astype(np.uint8))


def changes(frames: Iterable[np.ndarray], rate: Fraction) -> Iterator[np.ndarray]:
    """Difference of each luma frame (H, W) uint8 from the frames around it.

    Those are moved by the optical flow first: skin and cloth follow it, the mark does not. In
    deviations, float32; larger frames are scaled down, see `MAX_SIDE`.
    """
    with ThreadPoolExecutor(THREADS) as pool:
        yield from ordered(pool, _change, _with_near(frames, rate), ahead=THREADS)


def _with_near(frames: Iterable[np.ndarray], rate: Fraction) -> Iterator[tuple[Luma, list[Luma]]]:
    """Frames, each with the one or two that lie beside it."""
    apart = max(1, round(APART * rate))
    near: deque[Luma] = deque(maxlen=2 * apart + 1)

    def out(place: int) -> tuple[Luma, list[Luma]]:
        beside = [k for k in (place - apart, place + apart) if 0 <= k < len(near)]
        return near[place], [near[k] for k in beside]

    for frame in frames:
        near.append(Luma.of(_small(frame)))
        if len(near) > apart:
            yield out(len(near) - 1 - apart)
    for place in range(max(0, len(near) - apart), len(near)):
        yield out(place)


def _change(of: tuple[Luma, list[Luma]]) -> np.ndarray:
    """The difference of a frame from those beside it, moved onto it."""
    frame, beside = of
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    moved = [_moved(other, frame, flow) for other in beside]
    return normalized(frame.values - (sum(moved) / len(moved) if moved else frame.values))


def _moved(frame: Luma, to: Luma, flow: cv2.DISOpticalFlow) -> np.ndarray:
    """A frame (H, W) float32 warped onto another by their optical flow."""
    height, width = to.values.shape
    if min(height, width) < MIN_FLOW_SIDE:
        return frame.values
    found = flow.calc(to.small, frame.small, np.zeros((*to.small.shape, 2), np.float32))
    at: np.ndarray = cv2.resize(found, (width, height))
    at /= _share(height, width)
    at += _places(height, width)
    return np.asarray(cv2.remap(frame.values, at, NOTHING, cv2.INTER_CUBIC))


def _share(height: int, width: int) -> float:
    """Size of frames that flow is computed at, as a share of their own."""
    return min(1.0, FLOW_SIDE / min(height, width))


@lru_cache(maxsize=1)
def _places(height: int, width: int) -> np.ndarray:
    """Column and row of every pixel, (H, W, 2) float32."""
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return np.stack([x, y], -1)


def _small(frame: np.ndarray) -> np.ndarray:
    side = min(frame.shape)
    if side > MAX_SIDE:
        size = (round(frame.shape[1] * MAX_SIDE / side), round(frame.shape[0] * MAX_SIDE / side))
        frame = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    return frame.astype(np.float32)


def normalized(change: np.ndarray) -> np.ndarray:
    """A change (H, W) float32 less its surroundings, in their standard deviations."""
    cell = min(change.shape) / CELLS
    out: np.ndarray = cv2.GaussianBlur(change, (0, 0), max(0.3, 0.35 * cell))
    out -= cv2.GaussianBlur(change, (0, 0), 1.2 * cell)
    out /= np.maximum(deviation(out, 4 * cell), MIN_DEVIATION)
    return np.clip(out, -MAX_CHANGE, MAX_CHANGE, out=out)


def deviation(image: np.ndarray, radius: float) -> np.ndarray:
    """Standard deviation of an image (h, w) float32 in the square of ``radius`` round a pixel."""
    side = 2 * max(1, round(radius)) + 1
    mean: np.ndarray = cv2.blur(image, (side, side))
    square: np.ndarray = cv2.blur(image * image, (side, side))
    square -= mean * mean
    return np.sqrt(np.maximum(square, 0, out=square), out=square)


def pieces(frames: Iterable[np.ndarray], rate: Fraction) -> Iterator[tuple[np.ndarray, int]]:
    """Sums (BINS, H, W) over each piece, for every part of the period; and its frames."""
    length = max(1, round(PIECE * rate))
    bins, added = None, 0
    for number, change in enumerate(changes(frames, rate)):
        if bins is None:
            bins = np.zeros((BINS, *change.shape), np.float32)
        bins[math.floor(number / rate / PERIOD * BINS) % BINS] += change
        added += 1
        if added == length:
            yield bins, added
            bins, added = None, 0
    if bins is not None:
        yield bins, added


def by_phase(bins: np.ndarray) -> list[np.ndarray]:
    """Sums (BINS, H, W) weighted by the wave, (H, W) for each beginning of it."""
    weights = np.repeat(np.array(WAVE, np.float32), BINS // len(WAVE))
    return [np.tensordot(np.roll(weights, k), bins, 1) for k in range(BINS)]
