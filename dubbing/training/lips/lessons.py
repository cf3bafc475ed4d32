"""Clips of people who talk, as what is heard and what their lips do meanwhile.

Letters: F frames, T steps of 20 ms, S outputs of the acoustic network, N samples at 16 kHz.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from dubbing.face.lip_measures import lip_lengths, lips_touch, standardised
from dubbing.face.mouth_shape import INNER_LIP, OUTER_LIP, canonical_face, mouth_shape
from dubbing.sound_to_lips.network import OUTLINE
from dubbing.speech import acoustic_input as front
from dubbing.speech import listening
from dubbing.speech import voice_activity as voice
from dubbing.speech.acoustic_weights import SpeechModel, outputs
from dubbing.speech.rnn_features import voice_gate
from dubbing.sync.check import check
from dubbing.training.sync.clips import Recording, laid_on, recorded
from dubbing.training.sync.correlation import TRUSTED_PEAK, align

TAKES = 8
WARPS = (0.86, 1.16)  # of the vocal tract
SPEEDS = (-0.12, 0.12)  # logarithm
JUDGED = 12  # clips whose offset the sync network is asked about, too


@dataclass(frozen=True)
class Take:
    """One hearing of a sound: `activations` (T, S) and `voice` (T,), `speed` times as fast."""

    speed: float
    activations: torch.Tensor
    voice: torch.Tensor

    def moments(self, times: np.ndarray) -> np.ndarray:
        """Where moments (F,) of the clip, in seconds, lie among the steps."""
        return np.asarray(times / self.speed * voice.STEP_RATE - 0.5)


@dataclass(frozen=True)
class Lesson:
    """A clip: its lips at `times` (F,), and its sound as it is, then spoilt in several ways.

    `lips` (F, 7), `closed` (F,) and `outline` (F, 2 x 40) or, once it is told, (F, 8).
    """

    name: str
    times: np.ndarray
    lips: np.ndarray
    closed: np.ndarray
    outline: np.ndarray
    takes: tuple[Take, ...]

    def targets(self) -> torch.Tensor:
        """(F, 16) in the order of the network's outputs."""
        parts = [self.lips, self.closed[:, None], self.outline]
        return torch.from_numpy(np.concatenate(parts, 1)).float()


def lessons(
    paths: Sequence[Path], cache: Path, model: SpeechModel, seed: int, takes: int = TAKES
) -> list[Lesson]:
    """Measures clips of one talking person each; offsets of their sound are taken out.

    Args:
        cache: folder; what an earlier call measured is taken from there.

    Raises:
        SyncError: a clip shows no face.
        ValueError: fewer than three clips (own offsets are found by comparison).
    """
    cache.mkdir(parents=True, exist_ok=True)
    found = [recorded(path, cache) for path in tqdm(paths, "faces")]
    face = canonical_face(r.meshes for r in found)
    aligned, peaks = align(laid_on(found, face, pixels=False))
    offsets = np.array([clip.offset for clip in aligned])
    offsets -= common_offset(paths, offsets, np.array(peaks))
    rng = np.random.default_rng(seed)
    made = []
    for recording, offset in zip(tqdm(found, "sounds"), offsets, strict=True):
        made.append(lesson(recording, float(offset), face, model, rng, takes))
    return outlined(made)


def common_offset(paths: Sequence[Path], offsets: np.ndarray, peaks: np.ndarray) -> float:
    """What all offsets (C,) share, seconds: the sync network, whose zero is known, says it."""
    chosen = np.argsort(-peaks)[:JUDGED]
    apart = []
    for k in tqdm(chosen.tolist(), "zero"):
        result = check(paths[k])
        if peaks[k] >= TRUSTED_PEAK and result.offset_ms is not None:
            # The check counts how early the sound comes.
            apart.append(offsets[k] + result.offset_ms / 1000)
    return float(np.median(apart)) if apart else float(np.median(offsets))


def lesson(
    recording: Recording,
    offset: float,
    face: np.ndarray,
    model: SpeechModel,
    rng: np.random.Generator,
    takes: int,
) -> Lesson:
    """One clip, its outline as measured."""
    seen = np.isfinite(recording.meshes[:, 0, 0])
    points = recording.meshes[seen, :, :2].astype(np.float64)
    shape = mouth_shape(recording.meshes[seen], face)[:, : len(OUTER_LIP + INNER_LIP)]
    activations = [take(model, recording.samples)]
    for _ in range(takes):
        speed, warp = float(np.exp(rng.uniform(*SPEEDS))), float(rng.uniform(*WARPS))
        activations.append(
            take(model, spoilt(at_speed(recording.samples, speed), rng), speed, warp)
        )
    return Lesson(
        recording.path.stem,
        recording.times[seen] + offset,
        standardised(lip_lengths(points)),
        lips_touch(points).astype(np.float64),
        shape.reshape(len(shape), -1),
        tuple(activations),
    )


def take(model: SpeechModel, samples: np.ndarray, speed: float = 1.0, warp: float = 1.0) -> Take:
    """What the acoustic network hears of samples (N,)."""
    filters = front.filters(warp)
    windows = voice.step_windows([samples], front.STEP_WIDTH)
    spectra = torch.cat(
        [front.log_mel(torch.from_numpy(w.copy())[None], filters)[0] for w in windows]
    )
    activations = listening.hear(model.network, spectra, outputs)
    gate = voice_gate(voice.voice_activity(samples))
    return Take(speed, torch.from_numpy(activations).half(), torch.from_numpy(gate).half())


def at_speed(samples: np.ndarray, speed: float) -> np.ndarray:
    """Samples (N,) `speed` times as fast, pitch and formants alike."""
    count = int(len(samples) / speed)
    return np.interp(np.arange(count) * speed, np.arange(len(samples)), samples).astype(np.float32)


def spoilt(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Another microphone's tilt and, more often than not, noise 12 to 35 dB below."""
    count = len(samples)
    spectrum = np.fft.rfft(samples)
    place = np.linspace(0, 1, len(spectrum))
    wave = np.sin(2 * np.pi * place * rng.uniform(0.5, 3) + rng.uniform(0, 2 * np.pi))
    gain = rng.uniform(-12, 12) * (place - 0.5) + rng.uniform(-4, 4) * wave
    activations = np.fft.irfft(spectrum * 10 ** (gain / 20), count)
    if rng.random() < 0.6:
        noise = np.fft.rfft(rng.standard_normal(count))
        noise /= np.maximum(np.arange(len(noise)), 30) ** rng.uniform(0, 0.6)
        made = np.fft.irfft(noise, count)
        level = activations.std() * 10 ** (-rng.uniform(12, 35) / 20)
        activations = activations + made / made.std() * level
    return activations.astype(np.float32)


def outlined(found: Sequence[Lesson]) -> list[Lesson]:
    """The same with the outline on its principal directions over all, variance 1 for each."""
    moved = [one.outline - one.outline.mean(0) for one in found]
    some = np.concatenate([m[:: max(1, len(m) // 200)] for m in moved])
    directions = np.linalg.svd(some, full_matrices=False)[2][:OUTLINE]
    return [
        replace(one, outline=standardised(m @ directions.T))
        for one, m in zip(found, moved, strict=True)
    ]
