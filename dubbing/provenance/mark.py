"""The invisible mark: 64 bits as a keyed pattern on the luma of what a dub replaces, and around.

Spread spectrum: a tile of cells, each light or dark by the key and by the one bit that it carries,
repeats over the frame. A cell is a share of the frame's shorter side, so that a smaller copy holds
the same cells. The pattern stands still in the frame, and is as strong in flat as in busy parts:
what an encoder spares is worth more than what an eye overlooks. T cells a side of the tile, B bits.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

TILE = 64  # T
BITS = 64  # B
CELLS = 180  # along the shorter side of a frame
PSNR = 44.2  # dB of a marked frame, at least; a marked part of it may be changed more, up to
PART_PSNR = 42.0  # dB
AROUND = 0.25  # of the head crop's side, on every side of it
FADE = 0.06  # of the marked rectangle's shorter side, over which the mark sets in
Place = tuple[float, float, float]  # column, row and side of a head crop, px of the frame


@dataclass(frozen=True)
class Code:
    """What a key makes of the tile.

    Attributes:
        signs: (T, T) float32, -1 or 1.
        owners: (T, T) int64, which bit a cell carries: T * T / B cells each.
    """

    signs: np.ndarray
    owners: np.ndarray

    @staticmethod
    def of(key: bytes) -> Code:
        """The same for ever: drawn by SHAKE-256, not by a generator that may change."""
        cells = TILE * TILE
        drawn = hashlib.shake_256(b"dfrf mark" + key).digest(cells // 8 + 8 * cells)
        signs = np.unpackbits(np.frombuffer(drawn[: cells // 8], np.uint8)).astype(np.float32)
        order = np.argsort(np.frombuffer(drawn[cells // 8 :], "<u8"), kind="stable")
        owners = np.empty(cells, np.int64)
        owners[order] = np.arange(cells) % BITS
        return Code((2 * signs - 1).reshape(TILE, TILE), owners.reshape(TILE, TILE))

    def tile(self, bits: np.ndarray) -> np.ndarray:
        """The tile (T, T) float32 that carries ``bits`` (B,) of 0 or 1."""
        signed: np.ndarray = self.signs * (2 * bits[self.owners].astype(np.float32) - 1)
        return signed


class Mark:
    """Draws 64 bits onto frames of one size."""

    def __init__(self, key: bytes, bits: np.ndarray, width: int, height: int) -> None:
        cell = min(width, height) / CELLS
        border = cv2.copyMakeBorder(Code.of(key).tile(bits), 2, 2, 2, 2, cv2.BORDER_WRAP)
        down, across = (
            ((np.arange(n, dtype=np.float32) + 0.5) / cell - 0.5) % TILE + 2
            for n in (height, width)
        )
        grid = np.meshgrid(across, down)
        self._pattern = cv2.remap(border, grid[0], grid[1], cv2.INTER_CUBIC)

    def draw(self, frame: np.ndarray, places: Sequence[Place]) -> np.ndarray:
        """The frame (H, W, 3) uint8 with the mark on head crops and around them."""
        share, rows, columns = _shares(frame.shape[:2], places)
        delta = self._pattern[rows, columns] * share
        if not delta.any():
            return frame
        energy = float(np.sum(np.square(delta)))
        whole = _deviation_of(PSNR) * math.sqrt(frame.size / 3 / energy)
        part = _deviation_of(PART_PSNR) * math.sqrt(np.count_nonzero(share) / energy)
        levels = np.rint(min(whole, part) * delta).astype(np.int16)
        out = frame.copy()
        out[rows, columns] = np.clip(frame[rows, columns] + levels[..., None], 0, 255)
        return out


def _deviation_of(psnr: float) -> float:
    """Root of the mean square difference, levels."""
    return float(255 * 10 ** (-psnr / 20))


def _shares(size: tuple[int, int], places: Sequence[Place]) -> tuple[np.ndarray, slice, slice]:
    """How much of the mark a pixel bears, 0..1 float32 (h, w), of which rows and columns.

    Args:
        size: (H, W) of the frame. Outside of the rows and columns it bears none.
    """
    around = [
        tuple(
            slice(*np.clip([round(at - AROUND * side), round(at + (1 + AROUND) * side)], 0, most))
            for at, most in ((top, size[0]), (left, size[1]))
        )
        for left, top, side in places
    ]
    rows, columns = (
        slice(
            min((s[k].start for s in around), default=0),
            max((s[k].stop for s in around), default=0),
        )
        for k in (0, 1)
    )
    share = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.float32)
    for down, across in around:
        part = share[
            down.start - rows.start : down.stop - rows.start,
            across.start - columns.start : across.stop - columns.start,
        ]
        np.maximum(part, _fade(*part.shape), out=part)
    return share, rows, columns


def _fade(height: int, width: int) -> np.ndarray:
    """0 at the border of a rectangle (h, w), 1 from `FADE` of its shorter side on."""
    reach = max(1.0, FADE * min(height, width))
    down, across = (
        np.minimum((np.minimum(np.arange(n), np.arange(n)[::-1]) + 0.5) / reach, 1)
        for n in (height, width)
    )
    return (down[:, None] * across).astype(np.float32)
