"""Image sequences for tests."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO

TIMECODE = 0x01000000  # 01:00:00:00, as SMPTE packs it


def write_image(path: Path, values: np.ndarray, **tags: Any) -> Path:
    """A file of values (H, W, C): half floats or unsigned integers.

    Args:
        tags: attributes of OpenImageIO, with `__` for a colon; `rate` and `timecode`, packed.
    """
    kind = "half" if values.dtype == np.float16 else str(values.dtype)
    header = OpenImageIO.ImageSpec(values.shape[1], values.shape[0], values.shape[2], kind)
    for name, value in tags.items():
        if name == "rate":
            pair = Fraction(value).numerator, Fraction(value).denominator
            header.attribute("framesPerSecond", "rational", pair)
        elif name == "timecode":
            header.attribute("smpte:TimeCode", OpenImageIO.TypeTimeCode, (value, 0))
        elif name == "chromaticities":
            header.attribute(name, "float[8]", value)
        else:
            header.attribute(name.replace("__", ":"), value)
    target: Any = OpenImageIO.ImageOutput.create(str(path))
    assert target.open(str(path), header), target.geterror()
    assert target.write_image(values), target.geterror()
    target.close()
    return path


def write_sequence(path: Path, frames: list[np.ndarray], first: int = 1001, **tags: Any) -> Path:
    """Frames, numbered from a first one on, as ``shot.####.exr`` says."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for number, frame in enumerate(frames, first):
        write_image(path.with_name(path.name.replace("####", f"{number:04d}")), frame, **tags)
    return path


def read_image(path: Path) -> np.ndarray:
    """Values (H, W, C) of a file, float32."""
    source: Any = OpenImageIO.ImageInput.open(str(path))
    values = np.asarray(source.read_image("float"))
    source.close()
    return values
