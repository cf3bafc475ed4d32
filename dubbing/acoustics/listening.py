"""A whole sound through the acoustic network, in pieces, so that hours of it take little memory.

Letters: N samples at 16 kHz, T steps of 20 ms, W samples of a window, R = 2 spectra a step,
M = 64 mel bands, H hidden values.
"""

from collections.abc import Callable, Iterable

import numpy as np
import torch
from torch import Tensor

from dubbing import voice
from dubbing.acoustics import front
from dubbing.acoustics.network import AcousticNetwork, Heard

# Steps worked on at once, and how many more are heard on each side: 40 s and 3 s.
PIECE, AROUND = 2000, 150


def spectra_of(blocks: Iterable[np.ndarray]) -> Tensor:
    """Log-mel spectra of a sound that comes in pieces, (T, R, M) float16: 46 MB an hour."""
    filters = front.filters()
    found = [
        front.log_mel(torch.from_numpy(np.ascontiguousarray(w))[None], filters)[0].half()
        for w in voice.step_windows(blocks, front.STEP_WIDTH)
    ]
    return torch.cat(found) if found else torch.zeros(0, front.SPECTRA, front.BANDS).half()


@torch.no_grad()
def hear(network: AcousticNetwork, spectra: Tensor, taken: Callable[[Heard], Tensor]) -> np.ndarray:
    """What `taken` makes of the network's outputs (1, T, ...), for all steps, (T, D) float32.

    The level that is subtracted is that of the whole sound, so pieces fit together.
    """
    found = []
    levels = front.loud_average(spectra[None].float())
    for begin in range(0, len(spectra), PIECE):
        low, high = max(0, begin - AROUND), min(len(spectra), begin + PIECE + AROUND)
        part = front.levelled(spectra[None, low:high].float(), levels)
        made = taken(network(part))[0]
        found.append(made[begin - low :][:PIECE].numpy())
    return np.concatenate(found) if found else np.zeros((0, 0), np.float32)
