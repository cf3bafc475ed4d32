"""Training data of the lip filter: clips of talking people, as encoded sound and lip measures.

Letters: F frames, T steps of 24 ms, C channels of the encoder, N samples at 16 kHz.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from dubbing.face.mouth.lip_measures import lip_lengths, lips_touch, standardised
from dubbing.face.mouth.mouth_shape import canonical_face
from dubbing.sound_to_lips.encoder import STEP, SpeechEncoder, encode
from dubbing.sound_to_lips.predict import gain_of
from dubbing.speech import voice_activity as voice
from dubbing.speech.voice_activity import SAMPLE_RATE
from dubbing.sync.check import check
from dubbing.workshop.training.sync.clips import Recording, laid_on, recorded
from dubbing.workshop.training.sync.correlation import TRUSTED_PEAK, align

TAKES = 3  # beside the sound as it is
SPEEDS = (-0.12, 0.12)  # logarithm
CHECKED = 12  # clips whose offset the sync network measures, too


@dataclass(frozen=True)
class Take:
    """One take of a sound: the encoder's output (T, C), and how fast it is."""

    speed: float
    encoded: torch.Tensor

    def moments(self, times: np.ndarray) -> np.ndarray:
        """Where moments (F,) of the clip, in seconds, lie among the steps."""
        return np.asarray(times / self.speed * SAMPLE_RATE / STEP - 0.5)


@dataclass(frozen=True)
class LipClip:
    """A clip: its lips at `times` (F,), its sound unchanged and degraded in several ways.

    `lips` (F, 7) of mean 0 and variance 1, `closed` (F,) 1 where lips touch.
    """

    name: str
    times: np.ndarray
    lips: np.ndarray
    closed: np.ndarray
    takes: tuple[Take, ...]

    def targets(self) -> torch.Tensor:
        """(F, 8) in the order of the network's outputs."""
        return torch.from_numpy(np.concatenate([self.lips, self.closed[:, None]], 1)).float()


def lip_clips(
    paths: Sequence[Path], cache: Path, encoder: SpeechEncoder, seed: int
) -> list[LipClip]:
    """Measures clips of one talking person each; offsets of their sound are removed.

    Args:
        cache: folder that keeps measured clips for later calls.

    Raises:
        SyncError: a clip shows no face.
        ValueError: fewer than three clips (own offsets are found by comparison).
    """
    cache.mkdir(parents=True, exist_ok=True)
    recordings = [recorded(path, cache) for path in tqdm(paths, "faces")]
    face = canonical_face(r.meshes for r in recordings)
    aligned, peaks = align(laid_on(recordings, face, pixels=False))
    offsets = np.array([clip.offset for clip in aligned])
    offsets -= common_offset(paths, offsets, np.array(peaks))
    rng = np.random.default_rng(seed)
    return [
        lip_clip(recording, float(offset), encoder, rng, TAKES)
        for recording, offset in zip(tqdm(recordings, "sounds"), offsets, strict=True)
    ]


def common_offset(paths: Sequence[Path], offsets: np.ndarray, peaks: np.ndarray) -> float:
    """The error common to all offsets (C,), seconds, by the sync network, whose zero is known."""
    chosen = np.argsort(-peaks)[:CHECKED]
    apart = []
    for k in tqdm(chosen.tolist(), "zero"):
        result = check(paths[k])
        if peaks[k] >= TRUSTED_PEAK and result.offset_ms is not None:
            # The check counts how early the sound comes.
            apart.append(offsets[k] + result.offset_ms / 1000)
    return float(np.median(apart)) if apart else float(np.median(offsets))


def lip_clip(
    recording: Recording,
    offset: float,
    encoder: SpeechEncoder,
    rng: np.random.Generator,
    takes: int,
) -> LipClip:
    """A recording, measured, with so many degraded takes of its sound."""
    visible = np.isfinite(recording.meshes[:, 0, 0])
    points = recording.meshes[visible, :, :2].astype(np.float64)
    encoded = [take(encoder, recording.samples)]
    for _ in range(takes):
        speed = float(np.exp(rng.uniform(*SPEEDS)))
        encoded.append(take(encoder, degraded(at_speed(recording.samples, speed), rng), speed))
    return LipClip(
        recording.path.stem,
        recording.times[visible] + offset,
        standardised(lip_lengths(points)),
        lips_touch(points).astype(np.float64),
        tuple(encoded),
    )


def take(encoder: SpeechEncoder, samples: np.ndarray, speed: float = 1.0) -> Take:
    """The encoder's output for samples (N,)."""
    return Take(speed, encode(encoder, [samples], gain_of(voice.energy_db([samples]))).half())


def at_speed(samples: np.ndarray, speed: float) -> np.ndarray:
    """Samples (N,) `speed` times as fast, pitch and formants alike."""
    count = int(len(samples) / speed)
    return np.interp(np.arange(count) * speed, np.arange(len(samples)), samples).astype(np.float32)


def degraded(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Another microphone's tilt and, more often than not, noise 12 to 35 dB below."""
    count = len(samples)
    spectrum = np.fft.rfft(samples)
    place = np.linspace(0, 1, len(spectrum))
    wave = np.sin(2 * np.pi * place * rng.uniform(0.5, 3) + rng.uniform(0, 2 * np.pi))
    gain = rng.uniform(-12, 12) * (place - 0.5) + rng.uniform(-4, 4) * wave
    tilted = np.fft.irfft(spectrum * 10 ** (gain / 20), count)
    if rng.random() < 0.6:
        noise = np.fft.rfft(rng.standard_normal(count))
        noise /= np.maximum(np.arange(len(noise)), 30) ** rng.uniform(0, 0.6)
        added = np.fft.irfft(noise, count)
        level = tilted.std() * 10 ** (-rng.uniform(12, 35) / 20)
        tilted = tilted + added / added.std() * level
    return tilted.astype(np.float32)
