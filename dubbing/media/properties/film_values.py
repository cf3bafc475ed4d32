"""Values of a film in colour spaces of OpenColorIO, and the picture that a display shows of them.

Faces are found, learned and rendered in the display picture: RGB of 8 bits. Only what is changed
there is changed in the film's values, by as much. What no display shows, such as highlights, stays
where a pixel changes little; what becomes white beside them gets as bright. White of HDR, 203 cd/m2
(BT.2408), is white there. H x W pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any, Self

import numpy as np

from dubbing import packages
from dubbing.errors import MediaError

CONFIG = "ocio://studio-config-latest"
LINEAR = "lin_rec709_scene"  # linear light with the primaries of sRGB
SCENE, DISPLAY = "srgb_rec709_scene", "srgb_display"  # display pictures of the two kinds of films
STEPS = 255.0  # of the display picture
SHORT = {"rec709": "g24_rec709_scene"}  # names that OpenColorIO does not have
XYZ = "CIE XYZ-D65 - Display-referred"
WHITE = 203 / 100  # of HDR, where OpenColorIO has 1 for 100 cd/m2
FADE = 8  # power by which highlights fade as a pixel changes
NEAR = 8.0  # px, standard deviation of how far what is newly bright follows the film's highlights
LIGHTER = 0.01  # change from which on a pixel is newly bright
BRIGHT = (0.78, 0.96)  # of the display: what follows highlights, not at all and in full


@dataclass(frozen=True)
class FilmValues:
    """Values (H, W, 3) float32 of a film, 1 for white.

    Attributes:
        film: their colour space, as OpenColorIO calls it; '' where a display shows them as they
            are.
        working: that of the display picture; '' for sRGB.
    """

    film: str = ""
    working: str = ""

    @classmethod
    def of(cls, options: Mapping[str, str], tagged: str = "") -> Self:
        """The colour spaces that options of a film ask for, else the one it is tagged with.

        Raises:
            MediaError: OpenColorIO does not know one.
        """
        film, working = options.get("film", ""), options.get("working", "")
        return cls(space_of(film) if film else tagged, space_of(working) if working else "")

    def check(self) -> None:
        """Look for OpenColorIO, where it is needed.

        Raises:
            ExplainedError: it is not installed.
        """
        if self.film:
            spaces()

    def display(self, values: np.ndarray) -> np.ndarray:
        """The display's values (H, W, 3) float32, 0..1 for those that it can show."""
        shown = _applied(self._transforms[0], values) if self.film else values
        return np.nan_to_num(shown, nan=0.0)

    def picture(self, values: np.ndarray) -> np.ndarray:
        """The display picture (H, W, 3) uint8; uint16 values have 65,535 for 1."""
        if self.film:
            return _applied(self._transforms[2 + (values.dtype == np.uint16)], values, np.uint8)
        shown = np.clip(np.nan_to_num(values, nan=0.0), 0, 1) * np.float32(STEPS)
        return (shown + np.float32(0.5)).astype(np.uint8)

    def of_display(self, shown: np.ndarray) -> np.ndarray:
        """The film's values of a display's; the inverse of `display`."""
        return _applied(self._transforms[1], shown) if self.film else shown

    def changed(self, values: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Values with what differs between two pictures (H, W, 3) uint8; others bit for bit.

        Args:
            before: the display picture of the values.
        """
        differs = (before != after).any(-1)
        shown = self.display(values[None, differs])
        inside = np.clip(shown, 0, 1)
        more = (after[differs].astype(np.float32) - before[differs]) / np.float32(STEPS)
        beyond = (shown - inside) * (1 - np.abs(more).max(-1, keepdims=True)) ** FADE
        beyond = np.maximum(beyond, self._newly_bright(values, before, after)[differs])
        new = values.copy()
        new[differs] = self.of_display(np.clip(inside + more, 0, 1) + beyond)[0]
        return new

    def _newly_bright(
        self, values: np.ndarray, before: np.ndarray, after: np.ndarray
    ) -> np.ndarray:
        """Values beyond white of pixels (H, W, 3) that became as bright as others nearby.

        As of a collar of 400 cd/m2 that comes out behind a jaw: its picture ends at white.
        """
        import cv2  # which plans do without

        found = np.zeros(before.shape, np.float32)
        if not (before == STEPS).any():
            return found
        lighter = (cv2.subtract(after, before) > STEPS * LIGHTER) & (after > STEPS * BRIGHT[0])
        rows, columns = (np.flatnonzero(lighter.any((axis, 2))) for axis in (1, 0))
        if not len(rows):
            return found
        reach = round(3 * NEAR)
        part = tuple(slice(max(0, k[0] - reach), k[-1] + reach + 1) for k in (rows, columns))
        white = (before[part] == STEPS).any(-1)
        over = np.zeros((*white.shape, 4), np.float32)
        shown = self.display(values[part][None, white])[0]
        over[white] = np.pad(np.maximum(shown - 1, 0), ((0, 0), (0, 1)), constant_values=1)
        over = cv2.GaussianBlur(over, (2 * reach + 1,) * 2, NEAR)
        share = cv2.subtract(after[part], before[part]).max(-1) / (STEPS * LIGHTER)
        bright = np.interp(after[part].min(-1), np.multiply(BRIGHT, STEPS), (0, 1))
        share = (np.minimum(share, 1) * bright)[..., None]
        found[part] = share * over[..., :3] / (over[..., 3:] + np.float32(1e-3))
        return found

    @cached_property
    def _transforms(self) -> tuple[Any, ...]:
        return _transforms(self.film, self.working)


AS_SHOWN = FilmValues()


@cache
def spaces() -> Any:
    """The colour spaces that come with OpenColorIO.

    Raises:
        ExplainedError: it is not installed.
    """
    try:
        import PyOpenColorIO
    except ImportError as error:
        raise packages.lacking(["PyOpenColorIO"]) from error
    return PyOpenColorIO.Config.CreateFromFile(CONFIG)


def space_of(name: str) -> str:
    """OpenColorIO's name of a colour space; its own short names are known too, as LogC4.

    Raises:
        MediaError: there is none, or several.
    """
    config = spaces()
    if (known := config.getColorSpace(SHORT.get(name, name))) is not None:
        return str(known.getName())
    names = list(config.getColorSpaceNames())
    like = [one for one in names if name.casefold() in one.casefold().split()]
    like = like or [one for one in names if name.casefold() in one.casefold()]
    if len(like) == 1:
        return like[0]
    what = "several colour spaces are called so" if like else "OpenColorIO has no such colour space"
    raise MediaError(what, name, f"choose of: {', '.join(like or names)}")


@lru_cache(maxsize=8)
def _transforms(film: str, working: str) -> tuple[Any, ...]:
    """To the display, back, and quickly to its picture, of float32 and of uint16."""
    import PyOpenColorIO

    config = spaces()
    space, change = config.getColorSpace(film), PyOpenColorIO.ColorSpaceTransform
    of_display = space.getReferenceSpaceType() == PyOpenColorIO.REFERENCE_SPACE_DISPLAY
    if space.getEncoding() == "hdr-video" and not working:
        white = PyOpenColorIO.MatrixTransform.Scale([1 / WHITE] * 3 + [1])
        steps = [change(film, XYZ), white, change(XYZ, DISPLAY)]
    else:
        steps = [change(film, working or (DISPLAY if of_display else SCENE))]
    both = PyOpenColorIO.GroupTransform(steps)
    there, back = (
        config.getProcessor(both, way)
        for way in (PyOpenColorIO.TRANSFORM_DIR_FORWARD, PyOpenColorIO.TRANSFORM_DIR_INVERSE)
    )
    # Without losses: a value that goes there and back is the same.
    exact, quick = PyOpenColorIO.OPTIMIZATION_LOSSLESS, PyOpenColorIO.OPTIMIZATION_VERY_GOOD
    eight = PyOpenColorIO.BIT_DEPTH_UINT8
    return (
        there.getOptimizedCPUProcessor(exact),
        back.getOptimizedCPUProcessor(exact),
        there.getOptimizedCPUProcessor(PyOpenColorIO.BIT_DEPTH_F32, eight, quick),
        there.getOptimizedCPUProcessor(PyOpenColorIO.BIT_DEPTH_UINT16, eight, quick),
    )


def _applied(transform: Any, values: np.ndarray, kind: type = np.float32) -> np.ndarray:
    import PyOpenColorIO

    given = np.ascontiguousarray(values, None if values.dtype == np.uint16 else np.float32)
    out: np.ndarray = np.empty(given.shape, kind)
    depths = transform.getInputBitDepth(), transform.getOutputBitDepth()
    height, width = out.shape[:2]
    if not out.size:
        return out
    images: list[Any] = []
    for image, depth in zip((given, out), depths, strict=True):
        strides = (image.itemsize * n for n in (1, 3, 3 * width))
        images.append(PyOpenColorIO.PackedImageDesc(image, width, height, 3, depth, *strides))
    transform.apply(*images)
    return out
