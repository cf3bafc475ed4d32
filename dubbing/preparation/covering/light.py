"""The light of each frame, relative to the light that a shot mostly has.

In a fade, under a cloud or a lamp, the colours of a face are gain * usual + offset. Both are fitted
for every frame and channel to the points of the mesh that speech does not move. T frames, P = 478
points.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.face.mesh_points import LEFT_EYE_AND_BROW, RIGHT_EYE_AND_BROW

TINT = 0.13  # of a logarithm by which channels change differently: more is no light
LEAST_AROUND = 0.2  # see `shade`
BLUR = 0.012  # of the face's width: landmarks jitter by that much
ROUNDS = 8  # of iteratively reweighted least squares
HUBER = 1.5  # deviations from which on a point counts less: lids close, hair falls
COARSE = 0.5  # of a logarithm: how much a head that leaves the frame can change its mean
NOTICED = 0.12  # of a logarithm: a face that turns changes by as much
LEAST_GAIN = 0.02  # a darker frame shows nothing
# Offsets count from the first to the second of these, grey levels. A smaller one can come from a
# head that turns in light from the side; a larger one is haze, a fade to white or a dissolve.
HAZE_FROM, HAZE_FULL = 20.0, 40.0
# Turn from the usual view, rad, up to which an offset counts, and from which it does not: landmarks
# of a turned head lie beside dark brows and eyes, which looks like haze.
HAZE_KNOWN, HAZE_UNKNOWN = 0.2, 0.4


@dataclass(frozen=True)
class Light:
    """Light of frames: colours (0..255) are gain * usual + offset, both (T, 3)."""

    gain: np.ndarray
    offset: np.ndarray

    def lit(self, usual: np.ndarray) -> np.ndarray:
        """Usual colours (P, 3), relit to every frame, (T, P, 3)."""
        return np.asarray(self.gain[:, None] * usual + self.offset[:, None])

    def unlit(self, colours: np.ndarray) -> np.ndarray:
        """Colours (T, P, 3) of the frames, relit to the usual light."""
        return np.asarray((colours - self.offset[:, None]) / self.gain[:, None])


@dataclass(frozen=True)
class Sight:
    """A face, as frames see it.

    Attributes:
        colours: (T, P, 3) at the points of the mesh, NaN where a point is not seen.
        turn: (T,) from the usual view, rad.
        dark: (T, 3) of the darkest pixels of the frames: no haze is brighter.
    """

    colours: np.ndarray
    turn: np.ndarray
    dark: np.ndarray

    def of(self, frames: np.ndarray) -> "Sight":
        """Of some frames (T,) bool."""
        return Sight(self.colours[frames], self.turn[frames], self.dark[frames])


def sampled(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Colours (P, 3) float32 of an RGB image at points (P, 2 or more) px."""
    smooth = cv2.GaussianBlur(image, (0, 0), max(0.6, BLUR * float(np.ptp(points[:, 0]))))
    x, y = points[None, :, 0].astype(np.float32), points[None, :, 1].astype(np.float32)
    read = cv2.remap(smooth, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(read[0], np.float32)


def light_of(sight: Sight, usual: np.ndarray, still: np.ndarray) -> Light:
    """The light of frames, by robust least squares.

    Args:
        sight: of the frames.
        usual: (P, 3).
        still: indices of the points to compare. Eyes and brows are added: they are dark, and
            without them gain and offset cannot be separated.
    """
    index = np.union1d(still, (*LEFT_EYE_AND_BROW, *RIGHT_EYE_AND_BROW))
    own, of = sight.colours[:, index].astype(np.float64), usual[None, index].astype(np.float64)
    seen = ~np.isnan(own)
    own, weight = np.nan_to_num(own), seen.astype(np.float64)
    for _ in range(ROUNDS):
        total = weight.sum(1, keepdims=True)
        middle_of = (weight * of).sum(1, keepdims=True) / total
        middle = (weight * own).sum(1, keepdims=True) / total
        apart = of - middle_of
        gain = (weight * apart * (own - middle)).sum(1, keepdims=True)
        gain /= np.maximum((weight * apart**2).sum(1, keepdims=True), 1e-9)
        offset = middle - gain * middle_of
        left = np.abs(own - gain * of - offset)
        middle_left = np.nanmedian(np.where(seen, left, np.nan), 1, keepdims=True)
        weight = seen / np.maximum(1, left / (HUBER * np.maximum(1.4826 * middle_left, 1.0)))
    # Nothing takes light away from an image. What lies over it is grey: a channel may be dark in
    # all of a frame but the face.
    offset = np.clip(offset, 0, sight.dark[:, None]).min(2, keepdims=True).repeat(3, 2)
    counted = offset * np.clip((np.abs(offset) - HAZE_FROM) / (HAZE_FULL - HAZE_FROM), 0, 1)
    known = (HAZE_UNKNOWN - sight.turn) / (HAZE_UNKNOWN - HAZE_KNOWN)
    counted *= np.clip(known, 0, 1)[:, None, None]
    gain = (middle - counted) / np.maximum(middle_of, 1.0)
    return Light(np.maximum(gain[:, 0], LEAST_GAIN), counted[:, 0])


def shade(
    ratio: np.ndarray,
    where: np.ndarray,
    reach: float,
    least: float = LEAST_AROUND,
    redder: float = 0.0,
) -> np.ndarray:
    """Light that varies over a face, a logarithm (H, W, 3): what shadows and lamps do to colours.

    They change all channels nearly alike. Where these change differently, something else is seen,
    and the light is that of the places around.

    Args:
        ratio: (H, W, 3) logarithm of colours over those that are usual there.
        where: (H, W), share of a place that is known. reach: px, Gaussian; it varies more slowly.
        least: share of the places around that are known, below which it fades.
        redder: share of the ratio by which channels may differ, too: deep shade on skin is redder.
    """
    mean = ratio.mean(-1)
    tint = np.abs(ratio - mean[..., None]).max(-1) / (TINT + redder * np.abs(mean))
    weight = (where / (1 + tint**4)).astype(np.float32)
    parts = cv2.multiply(ratio.astype(np.float32), cv2.merge((weight,) * 3)), weight
    slow, around = (cv2.GaussianBlur(part, (0, 0), reach) for part in parts)
    return np.asarray(slow / (around + least)[..., None])


def coarse_gain(level: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Gain (T, 3) of frames without a face: 1 unless they are much darker or brighter.

    Args:
        level: (T, 3) mean colours of the frames. usual: (3,) of frames with a face.
    """
    ratio = np.maximum(level / np.maximum(usual, 1.0), LEAST_GAIN)
    large = np.abs(np.log(ratio)).min(1, keepdims=True) > COARSE
    return np.where(large, ratio, 1.0)


def noticed(gain: np.ndarray, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gain and offset (T, 3) of frames whose light is noticeably different, else 1 and 0."""
    same = (np.abs(np.log(gain)).max(1) < NOTICED) & ~offset.any(1)
    return np.where(same[:, None], 1.0, gain), np.where(same[:, None], 0.0, offset)
