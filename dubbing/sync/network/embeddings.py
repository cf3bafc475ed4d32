"""Embeddings of the mouths and the sound of a video at given moments.

Letters: F frames, W moments, E embedding size, M mouth points, R x C pixels, T x D sound channels.
"""

import numpy as np
import torch

from dubbing.sync.network.mouth_channels import mouth_channels
from dubbing.sync.network.sync_network import SyncNetwork
from dubbing.sync.network.windows import mouth_windows, sound_windows

BATCH = 256  # moments that go through the network at once


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
