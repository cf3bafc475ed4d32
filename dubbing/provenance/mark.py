"""The invisible mark: 64 bits as a keyed pattern on the luma of the pixels that a dub replaces.

Spread spectrum: a tile of cells, each light or dark by the key and by the one bit that it carries,
repeats over the frame. A cell is a share of the frame's shorter side, so that a smaller copy holds
the same cells. The pattern is turned round several times a second: one frame shows next to
nothing, and what stands still in the picture is no obstacle when it is looked for. It is
as strong as the picture hides: a fraction of a grey level where it is smooth, which dither spreads
over frames and pixels as grain does; more in what is rough, dark or very bright. No other pixel is
changed. T cells a side of the tile, B bits.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from fractions import Fraction

import cv2
import numpy as np

TILE = 64  # T
BITS = 64  # B
# Along the shorter side of a frame: coarse in a small one, where an encoder spares no finer cells,
# fine in one from `LARGE` px on, where faces are a small part and need many.
CELLS, FINE_CELLS, LARGE = 128, 192, 720
# What the pattern is multiplied with, a slot after the other: an m-sequence, which resembles no
# shift of itself, and none of its negative, so that a part of a film shows where it begins.
WAVE = (1, 1, 1, -1, -1, 1, -1)
SLOT = Fraction(2, 25)  # seconds
PERIOD = len(WAVE) * SLOT
# What a picture hides, grey levels: in a smooth part of middle brightness, for each level of
# roughness, and at most. Twice as much in black, half as much again in white.
SMOOTH, ROUGH, MOST = 0.7, 0.08, 2.0
SHADOW, LIGHT = 60.0, 180.0  # levels from which on darkness and brightness hide more
DETAIL, WIDE = 1.2, 1.5  # cells: what is finer is roughness, and the neighbourhood that hides
REACH = 4.0  # cells round a pixel: the smoothest place there decides, so that no edge hides
DITHER = 256  # px a side of its tile


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
    """Draws 64 bits onto frames of one size and rate."""

    def __init__(
        self, key: bytes, bits: np.ndarray, width: int, height: int, rate: Fraction
    ) -> None:
        side = min(width, height)
        self._cell, self._rate = side / (FINE_CELLS if side >= LARGE else CELLS), rate
        border = cv2.copyMakeBorder(Code.of(key).tile(bits), 2, 2, 2, 2, cv2.BORDER_WRAP)
        down, across = (
            ((np.arange(n, dtype=np.float32) + 0.5) / self._cell - 0.5) % TILE + 2
            for n in (height, width)
        )
        grid = np.meshgrid(across, down)
        self._pattern = cv2.remap(border, grid[0], grid[1], cv2.INTER_CUBIC)
        drawn = hashlib.shake_256(b"dfrf dither").digest(DITHER * DITHER)
        levels = np.frombuffer(drawn, np.uint8).reshape(DITHER, DITHER)
        self._dither = (levels.astype(np.float32) + 0.5) / 256

    def draw(self, frame: np.ndarray, replaced: np.ndarray, number: int) -> np.ndarray:
        """The frame (H, W, 3) uint8 with the mark on what is replaced.

        Args:
            replaced: (H, W) uint8, how much of each pixel is; 0: the film's own, which stays.
            number: of the frame in the dub.
        """
        sign = wave(number / self._rate)
        rows, columns = (np.flatnonzero(replaced.any(axis)) for axis in (1, 0))
        if not len(rows):
            return frame
        place = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        part, share = frame[place], replaced[place].astype(np.float32) / 255
        wanted = sign * hidden_by(part, self._cell) * share * self._pattern[place]
        turn = number * 97 % DITHER, number * 57 % DITHER  # another piece of it for every frame
        row, column = (np.arange(n) for n in part.shape[:2])
        dither = self._dither[(row[:, None] + turn[0]) % DITHER, (column + turn[1]) % DITHER]
        levels = np.where(share > 0, np.floor(wanted + dither), 0).astype(np.int16)
        out = frame.copy()
        out[place] = np.clip(part + levels[..., None], 0, 255)
        return out


def wave(seconds: Fraction) -> int:
    """Sign of the pattern at a time of the dub."""
    return WAVE[math.floor(seconds / SLOT) % len(WAVE)]


def hidden_by(picture: np.ndarray, cell: float) -> np.ndarray:
    """Grey levels (H, W) float32 by which luma may differ unseen, of an RGB picture uint8.

    A model of just noticeable differences as Chou and Li's (1995), far below it: masking by
    luminance and by contrast.

    Args:
        cell: px of a cell of the pattern.
    """
    luma = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float32)
    fine = luma - cv2.GaussianBlur(luma, (0, 0), DETAIL * cell)
    rough = np.sqrt(cv2.GaussianBlur(fine * fine, (0, 0), WIDE * cell))
    reach = max(1, round(REACH * cell))
    rough = cv2.erode(rough, np.ones((2 * reach + 1, 2 * reach + 1)))
    dark = np.clip((SHADOW - luma) / SHADOW, 0, 1)
    bright = np.clip((luma - LIGHT) / (255 - LIGHT), 0, 1)
    hidden = SMOOTH * (1 + dark + bright / 2) + ROUGH * rough
    return np.asarray(np.minimum(hidden, MOST))
