"""Crops of mouths, varied as faces, cameras, light and tracking vary them.

Everything happens to grey values, before they are compared with their mean, so that the mean mouth
changes with the mouth. Little of it is blur: a smeared mouth should count for less.

Letters: P stretches, G items of one, V = 5 mouth frames, N = G V images of a stretch, R rows and
C columns of a crop.
"""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS
from dubbing.sync.network.streams import MOUTH_FRAMES

# Half of the stretches were filmed with as little as this share of a crop's resolution.
_COARSEST = 0.45
# Deviations: of turn and shear in radians, of sizes as logarithms, of place in halves of a crop.
_TURN, _SHEAR = 0.08, 0.08
_SIZE, _WIDTH, _HEIGHT = 0.1, 0.1, 0.08
_ACROSS, _DOWN = 0.06, 0.1
# The crop shakes from frame to frame by at most this deviation, pixels.
_SHAKE = 0.6
_LIGHT = 0.04  # of the light's level and slopes from item to item
_NOISE = 4.0  # grey values
# Range in place of `channels.DARK`, so that black level and contrast vary; and a gamma.
_DARK = (6.0, 40.0)
_GAMMA = 0.2


def vary_pixels(mouths: np.ndarray, means: np.ndarray, rng: np.random.Generator) -> Tensor:
    """`channels.relative` of the stretches under other filming conditions, (P G, V, R C).

    Args:
        mouths: (P, G, V, R C) float32 grey values 0..255.
        means: the mean mouth of each stretch's surroundings, (P, R C).
    """
    stretches, items = mouths.shape[:2]
    images = torch.cat(
        [
            torch.from_numpy(mouths).view(stretches, -1, ROWS, COLUMNS),
            torch.from_numpy(means).view(stretches, 1, ROWS, COLUMNS),
        ],
        dim=1,
    )
    images = _warped(_coarse(images, rng), rng)
    mean = images[:, -1].view(stretches, 1, 1, ROWS, COLUMNS)
    visible = images[:, :-1].reshape(stretches, items, MOUTH_FRAMES, ROWS, COLUMNS)
    visible = _lit(visible, rng)
    low, high = np.log(_DARK)
    dark = _each(np.exp(rng.uniform(low, high, stretches)), visible)
    gamma = _each(np.exp(rng.normal(0, _GAMMA, stretches)), visible)
    varied = gamma * (torch.log(visible + dark) - torch.log(mean + dark))
    return varied.reshape(stretches * items, MOUTH_FRAMES, ROWS * COLUMNS)


def _each(values: np.ndarray, like: Tensor) -> Tensor:
    """Values of the leading axes, shaped to go with `like`."""
    tensor = torch.from_numpy(values.astype(np.float32))
    return tensor.view(*tensor.shape, *[1] * (like.dim() - tensor.dim()))


def _coarse(images: Tensor, rng: np.random.Generator) -> Tensor:
    """Every other stretch (P, N + 1, R, C), roughly, at a lower resolution and back."""
    for k in np.flatnonzero(rng.random(len(images)) < 0.5):
        share = rng.uniform(_COARSEST, 1)
        size = (round(ROWS * share), round(COLUMNS * share))
        small = F.interpolate(images[k][None], size, mode="bilinear", antialias=True)
        images[k] = F.interpolate(small, (ROWS, COLUMNS), mode="bilinear")[0]
    return images


def _warped(images: Tensor, rng: np.random.Generator) -> Tensor:
    """Stretches (P, N + 1, R, C) mirrored, turned, sized and moved; all but the last shaken."""
    stretches, count = images.shape[:2]
    side = np.where(rng.random(stretches) < 0.5, -1, 1)
    size = rng.normal(0, _SIZE, stretches)
    turn = rng.normal(0, _TURN, stretches)
    affine = np.zeros((stretches, count, 2, 3))
    affine[:, :, 0, 0] = (side * np.exp(size + rng.normal(0, _WIDTH, stretches)))[:, None]
    affine[:, :, 1, 1] = np.exp(size + rng.normal(0, _HEIGHT, stretches))[:, None]
    # Both axes run from -1 to 1, over unequal numbers of pixels.
    shear = turn + rng.normal(0, _SHEAR, stretches)
    affine[:, :, 0, 1] = (shear * ROWS / COLUMNS)[:, None]
    affine[:, :, 1, 0] = (-side * turn * COLUMNS / ROWS)[:, None]
    affine[:, :, :, 2] = rng.normal(0, (_ACROSS, _DOWN), (stretches, 1, 2))
    shake = rng.uniform(0, _SHAKE, (stretches, 1, 1)) * 2 / np.array([COLUMNS, ROWS])
    affine[:, :-1, :, 2] += rng.normal(0, 1, (stretches, count - 1, 2)) * shake
    grid = F.affine_grid(
        torch.from_numpy(affine.astype(np.float32)).view(-1, 2, 3),
        [stretches * count, 1, ROWS, COLUMNS],
        align_corners=False,
    )
    flat = images.reshape(-1, 1, ROWS, COLUMNS)
    warped = F.grid_sample(flat, grid, padding_mode="border", align_corners=False)
    return warped.view(images.shape)


def _lit(visible: Tensor, rng: np.random.Generator) -> Tensor:
    """Images (P, G, V, R, C) in light that changes a little from item to item, with noise."""
    down = torch.linspace(-1, 1, ROWS)[:, None]
    across = torch.linspace(-1, 1, COLUMNS)
    level, slope, tilt = (_each(x, visible) for x in rng.normal(0, _LIGHT, (3, *visible.shape[:2])))
    noise = _each(rng.uniform(0, _NOISE, len(visible)), visible)
    grain = torch.from_numpy(rng.standard_normal(visible.shape, dtype=np.float32))
    return (visible * (1 + level + slope * across + tilt * down) + noise * grain).clamp(min=0)
