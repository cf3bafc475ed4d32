"""The invisible mark: 64 bits as a keyed pattern on the luma of the pixels that a dub replaces.

Spread spectrum: a tile of cells, each light or dark by the key and by the one bit that it carries,
repeats over the frame. A cell is a share of the frame's shorter side, so that a smaller copy holds
the same cells. The sign of the pattern changes several times a second: one frame shows next to
nothing, and content that stands still does not disturb the search for it. Its strength is what the
image masks: a fraction of a grey level where the image is smooth, which dither spreads over frames
and pixels as grain does; more where it is rough, dark or very bright. No other pixel is changed.
T cells a side of the tile, B bits.
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
# Factors of the pattern, a slot after the other: an m-sequence, which resembles no shift of itself
# or of its negative, so that a part of a film shows where the sequence begins.
WAVE = (1, 1, 1, -1, -1, 1, -1)
SLOT = Fraction(2, 25)  # seconds
PERIOD = len(WAVE) * SLOT
# Changes that an image masks, grey levels: in a smooth part of middle brightness, for each level
# of roughness, and at most. Twice as much in black, half as much again in white.
SMOOTH, ROUGH, MAX_MASKED = 0.7, 0.08, 2.0
SHADOW, LIGHT = 60.0, 180.0  # levels below and above which darkness and brightness mask more
DETAIL, WIDE = 1.2, 1.5  # cells: finer detail is roughness; it is averaged over the second
NEIGHBOURHOOD = 4.0  # cells round a pixel: the smoothest place there decides, so that no edge masks
DITHER = 256  # px a side of its tile


@dataclass(frozen=True)
class Code:
    """The pattern of a key on the tile.

    Attributes:
        signs: (T, T) float32, -1 or 1.
        owners: (T, T) int64, which bit a cell carries: T * T / B cells each.
    """

    signs: np.ndarray
    owners: np.ndarray

    @staticmethod
    def of(key: bytes) -> Code:
        """The pattern of a key, drawn by SHAKE-256: no random generator, which may change."""
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
        """The frame (H, W, 3) uint8 with the mark on its replaced pixels.

        Args:
            replaced: (H, W) uint8, how much of each pixel is replaced; 0: the film's own.
            number: of the frame in the dub.
        """
        sign = wave(number / self._rate)
        rows, columns = (np.flatnonzero(replaced.any(axis)) for axis in (1, 0))
        if not len(rows):
            return frame
        place = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        part, share = frame[place], replaced[place].astype(np.float32) / 255
        wanted = sign * masked_by(part, self._cell) * share * self._pattern[place]
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


def masked_by(image: np.ndarray, cell: float) -> np.ndarray:
    """Grey levels (H, W) float32 by which luma may differ unseen in an RGB image uint8.

    A model of just noticeable differences as Chou and Li's (1995), far below it: masking by
    luminance and by contrast.

    Args:
        cell: px of a cell of the pattern.
    """
    luma = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    fine = luma - cv2.GaussianBlur(luma, (0, 0), DETAIL * cell)
    rough = np.sqrt(cv2.GaussianBlur(fine * fine, (0, 0), WIDE * cell))
    radius = max(1, round(NEIGHBOURHOOD * cell))
    rough = cv2.erode(rough, np.ones((2 * radius + 1, 2 * radius + 1)))
    dark = np.clip((SHADOW - luma) / SHADOW, 0, 1)
    bright = np.clip((luma - LIGHT) / (255 - LIGHT), 0, 1)
    masked = SMOOTH * (1 + dark + bright / 2) + ROUGH * rough
    return np.asarray(np.minimum(masked, MAX_MASKED))
