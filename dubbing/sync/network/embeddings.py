"""Embeddings of the mouths and the sound of a video at given moments.

Letters: F frames, W moments, E embedding size, M mouth points, R x C pixels, T x D sound channels;
of a moment V = 5 mouth frames, X values a frame, A = 10 sound steps.
"""

import numpy as np
import torch

from dubbing.speech.voice_activity import STEP_RATE, at_times
from dubbing.sync.network.channels import mouth_channels
from dubbing.sync.network.streams import MOUTH_FRAMES, MOUTH_STEP, SOUND_STEPS
from dubbing.sync.network.sync_network import SyncNetwork

_MOUTH_OFFSETS = (np.arange(MOUTH_FRAMES) - (MOUTH_FRAMES - 1) / 2) * MOUTH_STEP
_SOUND_OFFSETS = (np.arange(SOUND_STEPS) - (SOUND_STEPS - 1) / 2) / STEP_RATE
BATCH = 256  # moments that go through the network at once


def mouth_windows(
    mouths: np.ndarray, times: np.ndarray, moments: np.ndarray, stretch: float = 1.0
) -> np.ndarray:
    """Five mouths 40 ms (times `stretch`) apart around each moment, (W, V, X).

    Args:
        mouths: (F, X) at `times`, increasing: shapes or pixels.
        moments: seconds, (W,). At the ends of the video the outermost frame is repeated.
    """
    if len(times) == 1:
        return np.broadcast_to(mouths[:, None], (len(moments), MOUTH_FRAMES, mouths.shape[1]))
    wanted = np.clip(moments[:, None] + _MOUTH_OFFSETS * stretch, times[0], times[-1])
    after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    step = times[after] - times[after - 1]
    weight = ((wanted - times[after - 1]) / step).astype(np.float32)[..., None]
    # A neighbour of weight 0 must not spread its NaN.
    early = np.where(weight < 1, mouths[after - 1] * (1 - weight), 0)
    late = np.where(weight > 0, mouths[after] * weight, 0)
    return early + late


def sound_windows(sound: np.ndarray, moments: np.ndarray, stretch: float = 1.0) -> np.ndarray:
    """Ten steps of 20 ms (times `stretch`) around each moment, (W, A, D).

    Args:
        sound: (T, D), starting at second 0 of `moments` (W,); silence outside.
    """
    return at_times(sound, moments[:, None] + _SOUND_OFFSETS * stretch)


@torch.no_grad()
def mouth_embeddings(
    network: SyncNetwork, shapes: np.ndarray, crops: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Embeddings (F, E) of mouth shapes (F, M, 2) and crops (F, R, C) at `times` (F,).

    NaN where a frame is missing.
    """
    channels = mouth_channels(shapes, crops, times)
    valid = np.flatnonzero(np.isfinite(channels).all(1))
    embeddings = np.full((len(times), network.size), np.nan, np.float32)
    # A few moments at a time: five frames of pixels each take much memory.
    for first in range(0, len(valid), BATCH):
        chosen = valid[first : first + BATCH]
        windows = mouth_windows(channels, times, times[chosen])
        embeddings[chosen] = network.embed_mouth(torch.from_numpy(windows)).numpy()
    return embeddings


@torch.no_grad()
def sound_embeddings(network: SyncNetwork, sound: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Embeddings (W, E) of the channels `sound` (T, D) at `moments` (W,) from its start."""
    windows = sound_windows(sound, moments).astype(np.float32)
    return network.embed_sound(torch.from_numpy(windows)).numpy()
