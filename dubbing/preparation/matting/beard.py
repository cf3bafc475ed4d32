"""Tells a beard at the jaw from skin, and what looks like it from what does not.

Colours are CIELAB with lightness weighed less, so that shading is no beard. S is the side of the
crop in px. Lengths are for S = 512 and scale with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from dubbing.face.mesh_points import SKIN
from dubbing.preparation.matting.matting import REFERENCE_SIZE

LIGHTNESS = 0.6  # weight
INSIDE = (4.0, 9.0, 14.0)  # px above the jaw line: what is there is beard, if there is one
BLUR = 3.0  # px: hairs are no colour
ALONG = 4.0  # points of the jaw line over which its colours are smoothed
# Distance of the chin's colour from the skin's: up to the first no beard is there, from the second
# on one is. Chins of 15 clips without one have 2 to 16, three with one 22 to 30. Stubble in the
# shade had 28: its neck counts as beard.
DISTANCE = (17.0, 22.0)
CHIN = 0.12  # share of the line to either side of its middle
FRAMES = 15  # of a shot that are looked at
TIE = 2.0  # a colour must be nearer to skin than to the beard by this much to be skin
STEEP = 2.0  # of hairs: between alike and not there is little
LIGHT = (1.0, 0.6, 0.4)  # on skin, and in the shade


@dataclass(frozen=True)
class Beard:
    """That of a person in a shot.

    Attributes:
        share: how surely there is one, 0..1.
        colours: (P, 3), usual ones inside the jaw line, less those of lit skin.
    """

    share: float
    colours: np.ndarray

    @classmethod
    def of(cls, frames: Sequence[JawColours]) -> Beard:
        """That which some frames of a shot show."""
        usual = np.median([frame.distances() for frame in frames], axis=0)
        share = float(np.interp(np.median(usual[chin(len(usual))]), DISTANCE, (0, 1)))
        return cls(share, np.median([frame.jaw - frame.shades[0] for frame in frames], axis=0))


@dataclass(frozen=True)
class JawColours:
    """Colours of one frame.

    jaw (P, 3), inside the jaw line; shades (K, 3) of skin, lit first; share 0..1, how surely the
    jaw's are those of a beard.
    """

    jaw: np.ndarray
    shades: np.ndarray
    share: float = 0

    def usual(self, beard: Beard) -> JawColours:
        """With the jaw as it usually is: the line of a head that looks down lies on bare skin."""
        return replace(self, jaw=self.shades[0] + beard.colours, share=beard.share)

    def distances(self) -> np.ndarray:
        """Between jaw and lit skin, (P,)."""
        return np.asarray(np.linalg.norm(self.jaw - self.shades[0], axis=1))

    def unlike(self, rgb: np.ndarray) -> np.ndarray:
        """How unlike the jaw's colours (P, J, 3) uint8 RGB are, (P, J): -1 alike, 1 not.

        A neck lies in the shade of its chin: there it is skin, however dark it is.
        """
        # Where the jaw itself is bare, what hangs below it is the beard of the chin.
        local = np.interp(self.distances(), DISTANCE, (0, 1))[:, None]
        beard = self._of_chin()
        return self._unlike(rgb, (beard + local * (self.jaw - beard))[:, None])

    def like_hairs(self, image: np.ndarray) -> np.ndarray:
        """How like the chin's beard a pixel of (S, S, 3), or one beside it, is: (S, S) 0..1."""
        like = np.clip(0.5 - STEEP * self._unlike(image, self._of_chin()), 0, 1)
        return np.asarray(cv2.dilate(like, np.ones((3, 3))))  # hairs are thin and blurred

    def _of_chin(self) -> np.ndarray:
        return np.asarray(np.median(self.jaw[chin(len(self.jaw))], axis=0))

    def _unlike(self, rgb: np.ndarray, beard: np.ndarray) -> np.ndarray:
        """See `unlike`, for the beard's colours (3,) or (P, 1, 3)."""
        colours = weighed(rgb)
        jaw = np.linalg.norm(colours - beard, axis=2)
        skin = np.min([np.linalg.norm(colours - shade, axis=2) for shade in self.shades], axis=0)
        nearer = (jaw - skin - TIE) / np.maximum(jaw + skin, 1.0)
        apart = np.linalg.norm(beard - self.shades[0], axis=-1)
        far = jaw / np.maximum(apart, 1.0) - 1
        return np.asarray(np.clip(np.maximum(nearer, far), -1, 1))


def jaw_colours(
    image: np.ndarray, landmarks: np.ndarray, line: np.ndarray, normals: np.ndarray
) -> JawColours:
    """Colours of a frame.

    Args:
        image: (S, S, 3) uint8 RGB. landmarks: (478, 2) px.
        line: (P, 2) px, the jaw's. normals: (P, 2), of the line, pointing downwards.
    """
    unit = len(image) / REFERENCE_SIZE
    smooth = cv2.GaussianBlur(image, (0, 0), BLUR * unit)
    jaw = np.mean([sampled(smooth, line - away * unit * normals) for away in INSIDE], axis=0)
    skin = np.median(sampled(smooth, landmarks[list(SKIN)]), axis=0)
    # Light goes into CIELAB by its cube root, and lightness begins at -16.
    black = np.array([-16.0 * LIGHTNESS, 0, 0])
    shades = np.stack([(skin - black) * np.cbrt(light) + black for light in LIGHT])
    return JawColours(gaussian_filter1d(jaw, ALONG, axis=0, mode="nearest"), shades)


def sampled(image: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Colours (P, 3), see `weighed`, of an RGB image at places (P, 2) px."""
    x, y = places.astype(np.float32).T[:, None]
    at = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return weighed(at)[0]


def weighed(rgb: np.ndarray) -> np.ndarray:
    """CIELAB (..., 3) of colours (A, B, 3) uint8 RGB, lightness times LIGHTNESS."""
    lab = cv2.cvtColor(rgb.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    return np.asarray(lab * np.array([LIGHTNESS, 1, 1], np.float32))


def chin(points: int) -> slice:
    """The middle of a jaw line of so many points."""
    middle, reach = points // 2, round(CHIN * points)
    return slice(middle - reach, middle + reach)
