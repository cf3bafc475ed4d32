"""Runs the acoustic network on a sound in pieces, so that hours of it take little memory.

Letters: N samples at 16 kHz, T steps of 20 ms, W samples of a window, R = 2 spectra a step,
M = 64 mel bands, H hidden values.
"""

from collections.abc import Callable, Iterable

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from dubbing.speech import acoustic_input as front
from dubbing.speech import voice_activity as voice
from dubbing.speech.acoustic_network import AcousticNetwork, AcousticOutput

# Steps processed at once, and steps of context on each side: 40 s and 3 s.
PIECE, AROUND = 2000, 150


def spectra_of(blocks: Iterable[np.ndarray]) -> Tensor:
    """Log-mel spectra of a sound in blocks, (T, R, M) float16: 46 MB an hour."""
    filters = front.filters()
    spectra = [
        front.log_mel(torch.from_numpy(np.ascontiguousarray(w))[None], filters)[0].half()
        for w in voice.step_windows(blocks, front.STEP_WIDTH)
    ]
    return torch.cat(spectra) if spectra else torch.zeros(0, front.SPECTRA, front.BANDS).half()


def average_of(spectra: Float[Tensor, "T R M"]) -> Float[Tensor, "1 M"]:
    """`front.loud_average` of a long sound, T > 0, in pieces."""
    counted = front.loud(spectra.amax(2).float().flatten()[None])[0].unflatten(
        0, (len(spectra), -1)
    )
    total = torch.zeros(front.BANDS, dtype=torch.float64)
    for part, counts in zip(spectra.split(PIECE), counted.split(PIECE), strict=True):
        total += (part.float() * counts[:, :, None]).sum((0, 1))
    return front.loud_average(total.float()[None], counted.sum()[None, None])


@torch.no_grad()
def run_network(
    network: AcousticNetwork, spectra: Tensor, select: Callable[[AcousticOutput], Tensor]
) -> np.ndarray:
    """`select` of the network's outputs (1, T, ...), for all steps, (T, D) float32.

    The level that is subtracted is that of the whole sound, so pieces fit together. T > 0.
    """
    if not len(spectra):
        raise ValueError("the sound is empty")
    parts = []
    levels = average_of(spectra)
    for begin in range(0, len(spectra), PIECE):
        low, high = max(0, begin - AROUND), min(len(spectra), begin + PIECE + AROUND)
        part = front.levelled(spectra[None, low:high].float(), levels)
        selected = select(network(part))[0]
        parts.append(selected[begin - low :][:PIECE].numpy())
    return np.concatenate(parts)
