"""Input of the acoustic network: log-mel spectra 100 times a second, without level and microphone.

Letters: B sounds, T steps of 20 ms, W = 560 samples around a step, R = 2 spectra a step,
K = 257 bins, M = 64 mel bands.
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from dubbing.speech.mel_features import mel_filters
from dubbing.speech.voice_activity import HOP, LOUD_SHARE, SAMPLE_RATE

BANDS = 64
SPECTRA = 2  # a step
FFT = 512
WIDTH = 400  # samples of a spectrum, 25 ms
# Both spectra of a step lie within this many samples, centred on the step.
STEP_WIDTH = HOP // SPECTRA + WIDTH
# Spectra within this many orders of magnitude (10 dB) of the loudest count as loud.
_LOUD = 2.5
_PRIOR_SPECTRA = 50.0
_PRIOR_FALL = 3.5
_LOWEST, _HIGHEST, _MIDDLE, _SCALE = -4.0, 2.0, -1.0, 0.7


def filters(warp: float = 1.0) -> Tensor:
    """Mel filters (K, M); `warp` > 1 simulates a shorter vocal tract: formants higher by it."""
    plain = mel_filters(BANDS, FFT, SAMPLE_RATE)
    bins = np.arange(FFT // 2 + 1)
    # A warped spectrum through plain filters is a plain spectrum through warped ones. The top
    # fifth of the axis is bent so that it still ends at the top (Lee & Rose 1996).
    knee = 0.8 * bins[-1] / max(warp, 1.0)
    bent = np.where(
        bins <= knee,
        bins * warp,
        knee * warp + (bins - knee) * (bins[-1] - knee * warp) / (bins[-1] - knee),
    )
    read = np.stack([np.interp(bent, bins, row) for row in plain])
    return torch.from_numpy((read / read.sum(1, keepdims=True)).T.astype(np.float32))


def step_windows(samples: Float[Tensor, "B N"]) -> Float[Tensor, "B T W"]:
    """Windows around each of the N / 320 steps, padded with silence."""
    margin = (STEP_WIDTH - HOP) // 2
    return torch.nn.functional.pad(samples, (margin, margin)).unfold(1, STEP_WIDTH, HOP)


def log_mel(
    windows: Float[Tensor, "B T W"], filters: Float[Tensor, "*B K M"]
) -> Float[Tensor, "B T R M"]:
    """Logarithm (base 10) of the mel spectra, not normalised."""
    pieces = windows.unfold(2, WIDTH, HOP // SPECTRA)
    pieces = (pieces - pieces.mean(-1, keepdim=True)) * torch.hann_window(WIDTH)
    power = torch.fft.rfft(pieces, FFT).abs() ** 2
    flat = power.flatten(1, 2) @ filters
    return flat.clamp_min(1e-14).log10().unflatten(1, (-1, SPECTRA))


def loud(energy: Float[Tensor, "B TR"]) -> Float[Tensor, "B TR"]:
    """1 for loud spectra, 0 for the others, by the largest band of each."""
    rank = max(1, round(LOUD_SHARE * energy.shape[1]))
    loudest = energy.topk(rank, 1).values[:, -1:]
    return (energy >= loudest - _LOUD).float()


def loud_average(total: Float[Tensor, "B M"], number: Float[Tensor, "B 1"]) -> Tensor:
    """Average spectrum of the loud parts, (B, M), from the sum of `number` spectra.

    With few spectra it is biased towards a typical one, a line that falls over the bands. A band
    that is empty even in loud parts (a telephone) counts as at most 25 dB below the average band.
    """
    overall = total.mean(1, keepdim=True) / number
    prior = overall + _PRIOR_FALL * torch.linspace(0.5, -0.5, BANDS)
    average = (total + _PRIOR_SPECTRA * prior) / (number + _PRIOR_SPECTRA)
    return torch.maximum(average, overall - _LOUD)


def levelled(mel: Float[Tensor, "B T R M"], average: Float[Tensor, "B M"]) -> Tensor:
    """Input of the network, (B, T, R M): levels over the average, about -2 in silence to 2."""
    levels = (mel - average[:, None, None]).clamp(_LOWEST, _HIGHEST)
    return ((levels - _MIDDLE) * _SCALE).flatten(2)


def normalised(mel: Float[Tensor, "B T R M"]) -> Float[Tensor, "B T C"]:
    """`levelled` by their own averages, for short sounds, T > 0."""
    spectra = mel.flatten(1, 2)
    counted = loud(spectra.amax(2))[:, :, None]
    return levelled(mel, loud_average((spectra * counted).sum(1), counted.sum(1)))
