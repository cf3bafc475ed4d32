"""Embeddings of the mouths and the sound of a video, at given moments.

Letters: F frames, W moments, E embedding size, M mouth points, R x C pixels, T x D sound channels.
"""

import numpy as np
import torch

from dubbing.sync.sight import look
from dubbing.sync.sync_network import SyncNetwork
from dubbing.sync.windows import mouth_windows, sound_windows

TOGETHER = 256  # moments that go through the network at once


@torch.no_grad()
def mouth_embeddings(
    network: SyncNetwork, shapes: np.ndarray, crops: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Embeddings (F, E) of mouth shapes (F, M, 2) and crops (F, R, C) at `times` (F,).

    NaN where a frame is missing.
    """
    seen = look(shapes, crops, times)
    there = np.flatnonzero(np.isfinite(seen).all(1))
    found = np.full((len(times), network.size), np.nan, np.float32)
    # A few moments at a time: five frames of pixels each are much in memory.
    for first in range(0, len(there), TOGETHER):
        chosen = there[first : first + TOGETHER]
        looked = mouth_windows(seen, times, times[chosen])
        found[chosen] = network.embed_mouth(torch.from_numpy(looked)).numpy()
    return found


@torch.no_grad()
def sound_embeddings(network: SyncNetwork, sound: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Embeddings (W, E) of the channels `sound` (T, D) at `moments` (W,) from its start."""
    windows = sound_windows(sound, moments).astype(np.float32)
    return network.embed_sound(torch.from_numpy(windows)).numpy()
