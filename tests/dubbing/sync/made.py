"""Made talking clips: lips and sound that follow one random curve, with a known offset."""

import numpy as np

from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS
from dubbing.face.mouth.mouth_shape import mouth_shape
from dubbing.sync.network.channels import SOUND_CHANNELS
from dubbing.workshop.training.sync.clips import TalkingClip
from tests.dubbing.sync.meshes import canonical, talk


def made_clip(name: str, seed: int, late: float = 0.0, seconds: float = 8.0) -> TalkingClip:
    """A clip at 25 fps whose sound comes `late` seconds after the mouth.

    Opening and width are two smooth random curves; of each kind of channels the first half
    follows one, the second half the other.
    """
    rng = np.random.default_rng(seed)
    grid = np.arange(-2, seconds + 2, 0.02)
    curves = []
    for _ in range(2):
        noise = np.convolve(rng.normal(size=len(grid)), np.hanning(11), mode="same")
        curves.append(noise / noise.std())
    times = (np.arange(round(seconds * 25)) + 0.5) / 25
    height, wide = (np.interp(times, grid, c) for c in curves)
    shapes = mouth_shape(talk(0.1 + 0.03 * height, 0.5 + 0.05 * wide), canonical())
    heard = (np.arange(round(seconds * 50)) + 0.5) / 50 - late
    low, high = (np.interp(heard, grid, c) for c in curves)
    parts = []
    for part, level, reach in (("mel", 0.8, 0.2), ("rnn", 0.0, 0.6)):
        half = (SOUND_CHANNELS[part].stop - SOUND_CHANNELS[part].start) // 2
        parts += [level + reach * np.repeat(curve[:, None], half, 1) for curve in (low, high)]
    sound = np.concatenate(parts, axis=1)
    sound = sound + 0.05 * rng.normal(size=sound.shape)
    voice = np.ones(len(sound), np.float32)
    crops = made_crops(8 + 2.5 * height, 18 + 2 * wide)
    return TalkingClip(name, shapes, times, sound.astype(np.float32), voice, crops=crops)


def made_crops(height: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Crops (F, R, C) of a dark mouth opening, with half height and half width (F,) in pixels."""
    row, column = np.mgrid[:ROWS, :COLUMNS]
    down = (row - ROWS / 2) / np.maximum(height, 1)[:, None, None]
    across = (column - COLUMNS / 2) / np.maximum(width, 1)[:, None, None]
    inside = np.clip(4 * (1 - np.hypot(down, across)), 0, 1)
    return np.round(160 - 120 * inside).astype(np.uint8)
