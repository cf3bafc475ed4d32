"""Frames in the film's own values: planes of its bit depth and chroma, and changes made in them.

A frame is decoded twice: as RGB of 8 bits, in which faces are replaced, and as it is. Only what was
changed in the RGB picture is changed in the planes, by as much. So every other value stays the
film's own, and what is replaced keeps the film's finer steps. H x W pixels.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import av
import numpy as np

from dubbing.media.properties.colour import Colour
from dubbing.media.properties.film_values import AS_SHOWN, STEPS, FilmValues

WEIGHTS = {"bt709": (0.2126, 0.0722), "bt601": (0.299, 0.114), "bt2020": (0.2627, 0.0593)}  # R, B
APART = 8  # rows, more than a value of chroma has
CHROMA = {(0, 0): "444", (1, 0): "422", (1, 1): "420", (0, 1): "440", (2, 0): "411", (2, 2): "410"}
Planes = list[np.ndarray]


@dataclass(frozen=True)
class PixelFormat:
    """A planar format of pixels.

    Attributes:
        name: as ffmpeg calls it.
        bits: of a value. rgb: planes are green, blue, red, else luma and, if any, two of chroma.
        across, down: chroma has one value for 2^across columns and 2^down rows.
        count: of planes.
    """

    name: str
    bits: int
    rgb: bool = False
    across: int = 0
    down: int = 0
    count: int = 3

    @classmethod
    def holding(cls, name: str) -> PixelFormat:
        """The planar format that holds all values of another; its opacity is left out.

        RGB and greys may be packed, and halves of a plane interleaved, as in `nv12`: the same
        values in another order. What has no name of that kind becomes 4:4:4.
        """
        given = av.VideoFormat(name, 64, 64)
        bits = max(part.bits for part in given.components)
        deep = "" if bits <= 8 else f"{bits}le"
        colours = [part for part in given.components if not part.is_alpha]
        if given.is_rgb or given.has_palette or name.startswith("xyz"):
            return cls._named(f"gbrp{deep}", "gbrp16le", bits, rgb=True)
        if len(colours) < 3:
            return cls._named(f"gray{deep}", "gray16le", bits, count=1)
        across, down = (int(np.log2(64 / n)) for n in (colours[1].width, colours[1].height))
        sampling = CHROMA.get((across, down), "")
        own = cls._named(f"yuv{sampling}p{deep}", "", bits, across=across, down=down)
        return own if own.name else cls._named(f"yuv444p{deep}", "yuv444p16le", bits)

    @classmethod
    def _named(cls, name: str, otherwise: str, bits: int, **more: int | bool) -> PixelFormat:
        if _known(name):
            return cls(name, max(bits, 8), **more)  # type: ignore[arg-type]
        return cls(otherwise, 16, **more)  # type: ignore[arg-type]

    @property
    def kind(self) -> np.dtype[np.unsignedinteger]:
        """Type of a value."""
        return np.dtype(np.uint8 if self.bits == 8 else "<u2")

    def shapes(self, width: int, height: int) -> list[tuple[int, int]]:
        """Rows and columns of each plane."""
        chroma = -(-height // (1 << self.down)), -(-width // (1 << self.across))
        return [(height, width), *[chroma] * (self.count - 1)]

    def size(self, width: int, height: int) -> int:
        """Bytes of a frame."""
        return self.kind.itemsize * sum(
            rows * columns for rows, columns in self.shapes(width, height)
        )

    def planes(self, frame: np.ndarray, width: int, height: int) -> Planes:
        """Planes of a frame's bytes, which they share."""
        values, out = frame.view(self.kind), []
        for rows, columns in self.shapes(width, height):
            plane, values = np.split(values, [rows * columns])
            out.append(plane.reshape(rows, columns))
        return out

    def black(self, width: int, height: int, colour: Colour) -> Planes:
        """A black frame."""
        low = self._levels(colour)[0]
        values = [low, *[low if self.rgb else 1 << (self.bits - 1)] * (self.count - 1)]
        shapes = self.shapes(width, height)
        return [np.full(s, value, self.kind) for s, value in zip(shapes, values, strict=True)]

    def changed(
        self,
        planes: Planes,
        before: np.ndarray,
        after: np.ndarray,
        colour: Colour,
        values: FilmValues = AS_SHOWN,
    ) -> Planes:
        """Planes with what differs between two pictures (H, W, 3) uint8 RGB.

        Args:
            before: the picture that the planes show.
            colour: of the film: how planes stand for RGB. values: how that is shown.
        """
        places = list(self._places((before != after).reshape(len(before), -1)))
        if not places:
            return planes
        out = [plane.copy() for plane in planes]
        for rows, columns in places:
            one, other = before[rows, columns], after[rows, columns]
            parts = list(self._parts(out, rows, columns))
            if values.film:
                film = self._colours(parts, one.shape[:2], colour)
                more = (values.changed(film, one, other) - film) * np.float32(STEPS)
            else:
                more = other.astype(np.float32) - one
            for (part, *halvings), change in zip(parts, self._steps(more, colour), strict=True):
                new = np.rint(part + pooled(change, *halvings))
                part[...] = np.clip(new, 0, (1 << self.bits) - 1)
        return out

    def _parts(
        self, planes: Planes, rows: slice, columns: slice
    ) -> Iterator[tuple[np.ndarray, int, int]]:
        """The part of each plane in rows and columns, with its halvings of both."""
        for number, plane in enumerate(planes):
            halvings = (0, 0) if self.rgb or not number else (self.down, self.across)
            places = zip((rows, columns), halvings, strict=True)
            there = tuple(slice(s.start >> k, -(-s.stop // (1 << k))) for s, k in places)
            yield plane[there], *halvings

    def _places(self, differs: np.ndarray) -> Iterator[tuple[slice, slice]]:
        """Rows and columns that hold all that differs, (H, 3 W) bool: parts far from one another.

        A face and a label would lie in one part that is most of the frame.
        """
        some = np.flatnonzero(differs.any(1))
        for rows in np.split(some, np.flatnonzero(np.diff(some) > APART) + 1) if len(some) else ():
            part = self._span(rows, self.down)
            columns = np.flatnonzero(differs[part].any(0)) // 3
            yield part, self._span(columns, self.across)

    def _span(self, at: np.ndarray, halvings: int) -> slice:
        """From the first to the last, in whole values of chroma."""
        unit = 1 << halvings
        return slice(int(at[0]) // unit * unit, -(-(int(at[-1]) + 1) // unit) * unit)

    def _steps(self, more: np.ndarray, colour: Colour) -> list[np.ndarray]:
        """Changes of each plane from changes of RGB (h, w, 3), in steps of the format."""
        _, luma, chroma = (level / STEPS for level in self._levels(colour))
        if self.rgb:
            return [more[..., k] * luma for k in (1, 2, 0)]
        red, blue = WEIGHTS[colour.matrix]
        y = more @ np.array([red, 1 - red - blue, blue], np.float32)
        u, v = ((more[..., k] - y) / (2 - 2 * w) for k, w in ((2, blue), (0, red)))
        return [y * luma, u * chroma, v * chroma][: self.count]

    def _colours(
        self, parts: Sequence[tuple[np.ndarray, int, int]], size: tuple[int, ...], colour: Colour
    ) -> np.ndarray:
        """RGB (h, w, 3) float32, 1 for white, of parts of planes; the inverse of `_steps`."""
        low, luma, chroma = self._levels(colour)
        first, *others = (
            part.repeat(1 << down, 0).repeat(1 << across, 1)[: size[0], : size[1]]
            for part, down, across in parts
        )
        y = (first.astype(np.float32) - low) / luma
        if self.rgb:
            blue, red = (plane / np.float32(luma) for plane in others)
            return np.stack([red, y, blue], -1)
        if not others:
            return np.stack([y] * 3, -1)
        u, v = ((plane - np.float32(1 << (self.bits - 1))) / chroma for plane in others)
        of_red, of_blue = WEIGHTS[colour.matrix]
        red, blue = y + (2 - 2 * of_red) * v, y + (2 - 2 * of_blue) * u
        green = (y - of_red * red - of_blue * blue) / (1 - of_red - of_blue)
        return np.stack([red, green, blue], -1).astype(np.float32)

    def _levels(self, colour: Colour) -> tuple[int, int, int]:
        """Black, and from there to white, of luma or RGB; the whole range of chroma."""
        if self.rgb or self.count == 1 or colour.full_range:  # greys have all levels
            return 0, (1 << self.bits) - 1, (1 << self.bits) - 1
        return 16 << (self.bits - 8), 219 << (self.bits - 8), 224 << (self.bits - 8)


def _known(name: str) -> bool:
    try:
        return bool(av.VideoFormat(name, 2, 2).name)
    except ValueError:
        return False


def pooled(values: np.ndarray, down: int, across: int) -> np.ndarray:
    """Means of 2^down x 2^across values (h, w); at a cut edge, of those that are there."""
    for axis, halvings in ((0, down), (1, across)):
        if halvings:
            unit = 1 << halvings
            starts = np.arange(0, values.shape[axis], unit)
            sums = np.add.reduceat(values, starts, axis)
            counts = np.minimum(unit, values.shape[axis] - starts)
            values = sums / np.expand_dims(counts, 1 - axis)
    return values


YUV420 = PixelFormat("yuv420p", 8, across=1, down=1)
RGB = PixelFormat("gbrp", 8, rgb=True)
