"""The camera's part in a film: light, lens, motion of the hand, film stock."""

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.workshop.synthetic.anatomy.mesh import smoothstep
from dubbing.workshop.true_dubs.scenes import DUBBED, FRAMES, LEARNED, RATE, Look

UNIT = 320  # px, the side that lengths of a look are given for
GAMMA = 2.2
PALE = 194.0  # grey levels that a faded print tends to
GRAIN_SIGMA = 0.6  # px: grain is a little larger than a pixel
BAND, SOFT = 0.45, 0.08  # of the picture's width: a band of shadow, and half of its edge
SHAKES_S = 0.24  # seconds, Gaussian


@dataclass(frozen=True)
class CameraLook:
    """Adds a look to frames of side `size`, the same in every film."""

    look: Look
    size: int

    def picture(self, frame: np.ndarray, t: int) -> np.ndarray:
        """Frame t as the camera records it, (s, s, 3) uint8."""
        out: np.ndarray = self.framed(self.lit(np.asarray(frame, float), t), t)
        unit = len(out) / UNIT
        if self.look.defocus:
            out = np.asarray(cv2.GaussianBlur(out, (0, 0), self.look.defocus * unit))
        if self.look.mono:
            out = np.repeat(out @ np.array([[0.299], [0.587], [0.114]]), 3, 2)
        if t >= LEARNED * RATE:
            out = out + self.look.fade * (PALE - out)
        if self.look.grain:
            noise = np.random.default_rng(1000 + t).standard_normal(out.shape)
            grain = np.asarray(cv2.GaussianBlur(noise, (0, 0), GRAIN_SIGMA))
            out = out + grain * (self.look.grain / grain.std())
        return np.clip(out.round(), 0, 255).astype(np.uint8)

    def lit(self, image: np.ndarray, t: int) -> np.ndarray:
        """The frame under the lamp as it burns at that time: it is at the right, and warm.

        With the shadow or the beam that passes over it.
        """
        if not (self.look.flicker or self.look.band):
            return image
        seconds = t / RATE
        burns = np.sin(2 * np.pi * 1.7 * seconds) * np.sin(2 * np.pi * 0.45 * seconds + 0.4)
        across = np.linspace(0.35, 1, image.shape[1], dtype=np.float32)[None, :, None]
        colour = np.array([1.0, 0.85, 0.6], np.float32)
        gain = 1 + self.look.flicker * float(burns) * across * colour
        gain = gain * (1 - self.look.band * self.shadow(t, image.shape[1])[None, :, None])
        return 255 * (np.clip(gain * (image / 255) ** GAMMA, 0, 1) ** (1 / GAMMA))

    def shadow(self, t: int, width: int) -> np.ndarray:
        """How deep columns (width,) are in the band of shadow, 0..1, which comes from the left."""
        share = (t / RATE - LEARNED) / DUBBED
        front = share * (1 + BAND + 2 * SOFT) - SOFT
        behind = front - np.linspace(0, 1, width)
        return np.asarray(smoothstep(-SOFT, SOFT, behind) - smoothstep(-SOFT, SOFT, behind - BAND))

    def framed(self, image: np.ndarray, t: int) -> np.ndarray:
        """The frame as a camera sees it that is moved, zooms, or has fewer pixels."""
        transform, side = self.transform(t)
        if side == len(image) and np.allclose(transform, np.eye(3)[:2]):
            return image
        if self.look.shrink < 1:
            image = cv2.resize(image, (side, side), interpolation=cv2.INTER_AREA)
            return image
        warped = cv2.warpAffine(
            image, transform, (side, side), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
        )
        return np.asarray(warped)

    def transform(self, t: int) -> tuple[np.ndarray, int]:
        """Affine map (2, 3) from px of the rendered frame to the film's, and the film's side."""
        side = round(self.size * self.look.shrink / 2) * 2
        scale = side / self.size * self.look.zoom ** (t / FRAMES)
        middle = (self.size - 1) / 2
        shift = (side - 1) / 2 - scale * middle + self.strayed(t) * side / UNIT
        return np.array([[scale, 0, shift[0]], [0, scale, shift[1]]]), side

    def strayed(self, t: int) -> np.ndarray:
        """Where the hand holds the camera, (2,) px at `UNIT`."""
        rng = np.random.default_rng(17)
        steps = rng.standard_normal((FRAMES, 2))
        reach = np.arange(FRAMES) - t
        weight = np.exp(-0.5 * (reach / (SHAKES_S * RATE)) ** 2)
        return np.asarray(self.look.shake * (weight @ steps) / np.sqrt((weight**2).sum()))

    def points(self, points: np.ndarray, t: int) -> np.ndarray:
        """Points (..., 2) px of the rendered frame t, in px of the film."""
        transform, _ = self.transform(t)
        return points @ transform[:, :2].T + transform[:, 2]
