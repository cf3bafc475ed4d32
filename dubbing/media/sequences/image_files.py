"""EXR, DPX and TIFF files, read and written with OpenImageIO. H x W pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dubbing import packages
from dubbing.engine.disk.files import atomic_path
from dubbing.engine.disk.unchanged import while_unchanged
from dubbing.errors import MediaError

FORMATS = ("openexr", "dpx", "tiff")
TIMECODE = "smpte:TimeCode"
# Attributes that a file made for a frame takes from the film's.
KEPT = (TIMECODE, "framesPerSecond", "chromaticities", "PixelAspectRatio", "colorInteropID")
WHOLE = slice(None), slice(None)


@dataclass(frozen=True)
class Image:
    """An image file.

    Attributes:
        stored: (H, W, C) as stored: float32, or unsigned integers.
        header: OpenImageIO's. colours: channels of red, green and blue.
    """

    path: Path
    stored: np.ndarray
    header: Any
    colours: tuple[int, ...]

    @property
    def white(self) -> float:
        """The stored value that stands for 1."""
        kind = self.stored.dtype
        return 1.0 if kind.kind == "f" else float(np.iinfo(kind).max)

    def values(self, part: tuple[slice, slice] = WHOLE) -> np.ndarray:
        """Values (h, w, 3) float32 of its colours, in a part of it."""
        of_colour = self.stored[part]
        if self.colours != (0, 1, 2) or of_colour.shape[2] > 3:
            of_colour = of_colour[..., list(self.colours)]
        if self.white == 1:
            return of_colour
        return np.asarray(of_colour, np.float32) / np.float32(self.white)

    def with_values(
        self, values: np.ndarray, differs: np.ndarray, part: tuple[slice, slice] = WHOLE
    ) -> np.ndarray:
        """The stored array with other values (h, w, 3) in a part where they differ (h, w)."""
        out = self.stored.copy()
        new = values[differs] * self.white
        whole = new if self.white == 1 else np.clip(np.rint(new), 0, self.white)
        for channel, one in zip(self.colours, whole.T, strict=True):
            out[part][..., channel][differs] = one
        return out


@while_unchanged(4)  # two readers go through a film side by side, some frames apart
def read_image(file: Path) -> Image:
    """An image file. What is given must not be changed.

    Raises:
        MediaError: it cannot be read, or has no colours.
    """
    source = opened(file)
    header = source.spec()
    kind = str(header.format)
    stored = source.read_image(kind if kind.startswith("uint") else "float")
    problem = source.geterror()
    source.close()
    if stored is None or problem:
        raise MediaError("cannot be read", str(file), problem or "copy or render it again")
    colours = _colours(file, header.channelnames)
    stored = stored.reshape(header.height, header.width, header.nchannels)
    return Image(file, stored, header, colours)


def _colours(file: Path, names: Sequence[str]) -> tuple[int, ...]:
    """Channels of red, green and blue: of no layer, else of the only one that has them."""
    layers: dict[str, dict[str, int]] = {}
    for k, (layer, _, colour) in enumerate(name.rpartition(".") for name in names):
        layers.setdefault(layer, {}).setdefault(colour.upper(), k)
    having = {layer: own for layer, own in layers.items() if {*"RGB"} <= {*own}}
    if not having:
        what = f"has the channels {', '.join(names)}: no R, G and B"
        raise MediaError(what, str(file), "give RGB, in the first part of a file of several")
    if "" not in having and len(having) > 1:
        what = f"has the layers {', '.join(having)}, and no R, G and B of its own"
        raise MediaError(what, str(file), "give the film as R, G and B")
    own = having.get("") or next(iter(having.values()))
    return tuple(own[colour] for colour in "RGB")


def write_image(
    file: Path,
    stored: np.ndarray,
    header: Any,
    *,
    channels: tuple[str, ...] = (),
    corner: tuple[int, int] = (0, 0),
    tags: Mapping[str, str] | None = None,
) -> None:
    """Write an image file, whole or not at all.

    Args:
        stored: (H, W, C), all of a frame; or with ``channels`` a part of it, as half floats.
        header: of the film's file.
        channels: names of the layers' channels.
        corner: column and row of the part's corner in the frame.

    Raises:
        MediaError: it cannot be written.
    """
    import OpenImageIO

    if channels:
        rows, columns, count = stored.shape
        made = OpenImageIO.ImageSpec(columns, rows, count, "half")
        made.x, made.y = header.x + corner[0], header.y + corner[1]
        made.full_x, made.full_y = header.full_x, header.full_y
        made.full_width, made.full_height = header.full_width, header.full_height
        made.channelnames = channels
        made.attribute("compression", "zips")
        for one in header.extra_attribs:
            if one.name in KEPT:
                made.attribute(one.name, one.type, one.value)
    else:
        made = OpenImageIO.ImageSpec(header)
    made.attribute("openexr:ACESContainerPolicy", "none")
    for key, text in (tags or {}).items():
        made.attribute(key, text)
    with atomic_path(file) as temporary:
        target: Any = OpenImageIO.ImageOutput.create(str(temporary))
        done = target.open(str(temporary), made) and target.write_image(stored)
        problem = target.geterror()
        if not target.close() or not done:
            raise MediaError("cannot be written", str(file), problem or target.geterror())


def opened(file: Path) -> Any:
    try:
        import OpenImageIO
    except ImportError as error:
        raise packages.lacking(["OpenImageIO"]) from error
    as_stored = OpenImageIO.ImageSpec()
    as_stored.attribute("oiio:UnassociatedAlpha", 1)  # else colours are multiplied by opacity
    source = OpenImageIO.ImageInput.open(str(file), as_stored)
    if source is None:
        raise MediaError("cannot be read", str(file), OpenImageIO.geterror() or "copy it again")
    if source.format_name() not in FORMATS:
        what = f"is of the format {source.format_name()}"
        raise MediaError(what, str(file), "give EXR, DPX or TIFF")
    return source


def header_of(file: Path) -> Any:
    source = opened(file)
    header = source.spec()
    source.close()
    return header
