"""Films of numbered EXR, DPX or TIFF files. H x W pixels.

Every other stage sees the display picture of their values; see `film_values`.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dubbing.engine.disk.numbered import numbered
from dubbing.engine.disk.unchanged import while_unchanged
from dubbing.errors import MediaError
from dubbing.media.properties.colour import Colour
from dubbing.media.properties.film_values import LINEAR, FilmValues
from dubbing.media.properties.frame_rate import snap
from dubbing.media.properties.info import MediaInfo, Picture
from dubbing.media.properties.native import RGB
from dubbing.media.sequences.image_files import TIMECODE, Image, header_of, read_image
from dubbing.script.timecode import frame_of, timecode_of

RATES = ("FramesPerSecond", "framesPerSecond", "dpx:TemporalFrameRate", "dpx:FrameRate")
# Colour spaces by the primaries and the white that an EXR names: x and y of each.
CHROMATICITIES = {
    "lin_ap0_scene": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
    "lin_ap1_scene": (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767),
    LINEAR: (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329),
    "lin_p3d65_scene": (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329),
    "lin_rec2020_scene": (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329),
}
NEAR = 0.002  # largest difference of one of them


def probe(path: Path) -> MediaInfo:
    """The properties of a film of numbered files, by their names and the header of the first.

    Raises:
        MediaError: none is there, some are missing, or one cannot be read; OpenColorIO does not
            know its colour space, or that must be named.
    """
    sequence = numbered(path)
    assert sequence is not None
    if not sequence.files():
        remedy = "its numbers are 0 or more, with digits alone"
        raise MediaError("no such files", str(sequence.plain), remedy)
    return _probe(path)


@while_unchanged(1024)
def _probe(path: Path) -> MediaInfo:
    sequence = numbered(path)
    assert sequence is not None
    files, where = sequence.files(), str(sequence.plain)
    if gaps := [(low + 1, high - 1) for low, high in pairwise(files) if high > low + 1]:
        named = ", ".join(f"{low}" if low == high else f"{low}-{high}" for low, high in gaps)
        raise MediaError(f"frames are missing: {named}", where, "render or copy them again")
    first = next(iter(files))
    header = header_of(files[first])
    if header.getattribute("PixelAspectRatio") not in (None, 0.0, 1.0):
        raise MediaError("its pixels are not square", where, "resize it to square pixels")
    options = sequence.options
    film = options.get("film") or _space(files[first], header)
    rate = _rate(header, options.get("rate"), where)
    written = header.get_string_attribute(TIMECODE)
    try:
        frame_of(written, rate)
    except ValueError:
        written = timecode_of(first, rate)
    return MediaInfo(
        path=path,
        width=header.width,
        height=header.height,
        frame_rate=rate,
        frames=len(files),
        duration=float(len(files) / rate),
        variable_rate=False,
        video_start=0.0,
        picture=Picture(header.width, header.height, Colour(), pixels=RGB),
        audio_rate=None,
        audio_channels=None,
        audio_duration=None,
        audio_start=0.0,
        timecode=written,
        values=FilmValues.of(options | {"film": film}),
    )


def read(path: Path, frame: int) -> Image:
    """A frame of a film of numbered files, counted from 0.

    Raises:
        MediaError: see `read_image`.
    """
    sequence = numbered(path)
    assert sequence is not None
    return read_image([*sequence.files().values()][frame])


def read_frames(path: Path, start: int, count: int | None, rate: Fraction) -> Iterator[np.ndarray]:
    """Display pictures (H, W, 3) uint8; see `reading.read_frames`.

    Raises:
        MediaError: one is of another size than the first; see `read_image`.
    """
    info, sequence = probe(path), numbered(path)
    assert sequence is not None
    files = [*sequence.files().values()]
    total = round(info.frames * rate / info.rate)
    corner = _corner(header_of(files[0]))
    for k in range(start, total if count is None else min(total, start + count)):
        file = files[min(int(k * info.rate / rate + Fraction(1, 2)), info.frames - 1)]
        image = read_image(file)
        if image.stored.shape[:2] != (info.height, info.width):
            size = f"{image.stored.shape[1]}x{image.stored.shape[0]} px"
            what = f"is {size}, not {info.width}x{info.height} as the first"
            raise MediaError(what, str(file), "give frames of one size")
        if _corner(image.header) != corner:
            what = f"has its data window at {_corner(image.header)}, the first at {corner}"
            raise MediaError(what, str(file), "write it with one data window")
        yield info.values.picture(image.values())


def _corner(header: Any) -> tuple[int, int]:
    return header.x, header.y


def _rate(header: Any, asked: str | None, where: str) -> Fraction:
    if asked:
        return Fraction(asked)
    for name in RATES:
        value = header.getattribute(name)
        if isinstance(value, tuple | list) and len(value) == 2 and value[1]:
            return Fraction(*value)
        if isinstance(value, float) and 1 <= value <= 1000:
            return snap(Fraction(value).limit_denominator(1001))
    raise MediaError("no frame rate in its files", where, "give it beside the clip, as `rate: 24`")


def _space(file: Path, header: Any) -> str:
    """The colour space that a header names; '' where a display shows the values as they are."""
    if file.suffix.lower() == ".dpx" and header.getattribute("dpx:Transfer") in (
        *("Logarithmic", "Printing density"),
    ):
        what = "its values are logarithmic, and nothing says of which camera"
        raise MediaError(what, str(file), "name it beside the clip, as `colour: {film: LogC4}`")
    if file.suffix.lower() != ".exr":
        return ""
    if named := header.get_string_attribute("colorInteropID"):
        return str(named)
    given = header.getattribute("chromaticities") or CHROMATICITIES[LINEAR]
    for name, known in CHROMATICITIES.items():
        if np.abs(np.subtract(given, known)).max() < NEAR:
            return name
    what = "its primaries are of no colour space that is known here"
    raise MediaError(what, str(file), "name it beside the clip, as `colour: {film: ACEScg}`")
