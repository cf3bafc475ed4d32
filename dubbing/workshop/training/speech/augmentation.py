"""Batches for the acoustic network: degraded sound, and targets of the clean one.

Varied are rate and pitch (resampling), the length of the vocal tract, the room, the microphone's
and the line's band, noise, babble, coarse quantisation, clipping and pauses.

Letters: B items, N samples of an item, T steps of 20 ms, K bins of the Fourier transform.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from dubbing.speech import acoustic_input as front
from dubbing.speech.phone_classes import SILENCE
from dubbing.speech.voice_activity import HOP, SAMPLE_RATE, STEP_RATE
from dubbing.workshop.training.speech.corpus import Part, Utterance
from dubbing.workshop.training.speech.phones import UNKNOWN
from dubbing.workshop.training.speech.synthesis import ESPEAK, FESTIVAL, FLITE

ITEMS = 32
SECONDS = 4.0
# How often each source is drawn; parts of a source share alike, people by the length they speak.
SHARES = {"real": 0.25, FLITE: 0.4, ESPEAK: 0.25, FESTIVAL: 0.1}
WARPS = np.linspace(0.84, 1.18, 13)


@dataclass(frozen=True)
class Batch:
    """Input (B, T, C); senones (B, T, S); phones (B, T) int64; lips (B, T, M); known (B, T)."""

    spectra: Tensor
    senones: Tensor
    phones: Tensor
    lips: Tensor
    known: Tensor


def source_of(part: Part) -> str:
    return "real" if part.real else part.name.split("-")[0]


class Batches:
    """Random batches of a corpus; the same seed gives the same ones."""

    def __init__(self, parts: Sequence[Part], rng: np.random.Generator, items: int = ITEMS) -> None:
        self.rng = rng
        self._items = items
        self._steps = round(SECONDS * STEP_RATE)
        self._samples = self._steps * HOP
        self._filters = torch.stack([front.filters(float(w)) for w in WARPS])
        self._parts = parts
        weights = np.zeros(len(parts))
        for source, share in SHARES.items():
            mine = [k for k, part in enumerate(parts) if source_of(part) == source]
            sizes = np.array([self._size(parts[k]) for k in mine])
            weights[mine] = share * sizes / sizes.sum() if mine else 0
        self._weights = weights / weights.sum()

    @staticmethod
    def _size(part: Part) -> float:
        seconds = sum(len(u.samples) for u in part.utterances) / SAMPLE_RATE
        return min(1.0, seconds / 20) ** 0.5 if part.real else 1.0

    def draw(self) -> Batch:
        rng = self.rng
        drawn = [self._item() for _ in range(self._items)]
        sound = torch.from_numpy(np.stack([d[0] for d in drawn]))
        sound = self._spoilt(sound)
        warps = torch.from_numpy(rng.integers(len(WARPS), size=self._items))
        mel = front.log_mel(front.step_windows(sound), self._filters[warps])
        senones, phones, lips, known = (
            torch.from_numpy(np.stack([d[k] for d in drawn])) for k in range(1, 5)
        )
        return Batch(front.normalised(mel), senones, phones, lips, known)

    def _item(self) -> tuple[np.ndarray, ...]:
        """Samples, senones, phones, lips and known of one item: utterances one after the other."""
        rng = self.rng
        part = self._parts[rng.choice(len(self._parts), p=self._weights)]
        filled, pieces = 0, []
        while filled < self._steps:
            chosen = part.utterances[rng.integers(len(part.utterances))]
            pieces.append(self._resampled(chosen, float(np.exp(rng.uniform(-0.15, 0.15)))))
            filled += len(pieces[-1][1])
        first = int(rng.integers(0, max(1, len(pieces[0][1]) - self._steps // 2)))
        joined = [np.concatenate([p[k] for p in pieces]) for k in range(4)]
        sound = joined[0][first * HOP :][: self._samples]
        sound = np.pad(sound, (0, self._samples - len(sound)))
        targets = []
        for values, outside in zip(joined[1:], (0.0, UNKNOWN, np.nan), strict=True):
            cut = values[first:][: self._steps]
            padding = [(0, self._steps - len(cut))] + [(0, 0)] * (cut.ndim - 1)
            targets.append(np.pad(cut, padding, constant_values=outside))
        known = np.zeros(self._steps, np.float32)
        known[: len(joined[1]) - first] = 1
        if rng.random() < 0.25:
            self._pause(sound, targets, known)
        return sound, *targets, known

    def _pause(self, sound: np.ndarray, targets: list[np.ndarray], known: np.ndarray) -> None:
        """Silences a stretch. The lips are at rest from 0.1 s on, senones count for nothing."""
        length = int(self.rng.integers(10, 50))
        low = int(self.rng.integers(0, self._steps - length))
        sound[low * HOP : (low + length) * HOP] = 0
        targets[0][low : low + length] = 0
        targets[1][low : low + length] = SILENCE
        targets[2][low : low + length] = np.nan
        if (targets[1][low - 1 : low] != UNKNOWN).all():
            targets[2][low + 5 : low + length - 5] = 0

    def _resampled(self, utterance: Utterance, speed: float) -> tuple[np.ndarray, ...]:
        """The utterance `speed` times as fast, pitch and formants alike."""
        count = max(1, int(len(utterance.classes) / speed))
        places = np.arange(count * HOP, dtype=np.float32) * np.float32(speed)
        sound = np.interp(places, np.arange(len(utterance.samples)), utterance.samples)
        nearest = np.clip(((np.arange(count) + 0.5) * speed).astype(int), 0, None)
        nearest = np.minimum(nearest, len(utterance.classes) - 1)
        return (
            (sound / 32768).astype(np.float32),
            utterance.senones[nearest].astype(np.float32),
            utterance.classes[nearest].astype(np.int64),
            utterance.lips[nearest].astype(np.float32),
        )

    def _spoilt(self, sound: Tensor) -> Tensor:
        """Room, line, noise, quantisation and clipping for sounds (B, N)."""
        rng = self.rng
        size = self._samples + SAMPLE_RATE // 2
        spectrum = torch.fft.rfft(sound, size) * self._channels(size)
        recording = torch.fft.irfft(spectrum, size)[:, : self._samples]
        level = recording.square().mean(1, keepdim=True).sqrt() + 1e-5
        recording = recording / level
        noisy = rng.random(len(sound)) < 0.7
        snr = np.where(noisy, rng.uniform(0, 30, len(sound)), 45)
        amount = torch.from_numpy((10 ** (-snr / 20)).astype(np.float32))[:, None]
        recording = recording + amount * self._noise(recording, size)
        recording = recording * torch.from_numpy(
            rng.uniform(0.03, 0.2, (len(sound), 1)).astype(np.float32)
        )
        for k in np.flatnonzero(rng.random(len(sound)) < 0.15):
            peak = float(recording[k].abs().max())
            if rng.random() < 0.5:
                limit = peak * rng.uniform(0.15, 0.6)
                recording[k] = recording[k].clamp(-limit, limit)
            else:
                mu = 2.0 ** rng.integers(4, 9)
                pressed = torch.log1p(mu * recording[k].abs() / peak) / np.log1p(mu)
                coarse = torch.round(pressed * mu) / mu * recording[k].sign()
                recording[k] = coarse.sign() * peak * ((1 + mu) ** coarse.abs() - 1) / mu
        return recording

    def _channels(self, size: int) -> Tensor:
        """Transfer functions of room, microphone and line, (B, K) complex."""
        rng = self.rng
        hertz = np.arange(size // 2 + 1) * SAMPLE_RATE / size
        octaves = np.log2(np.maximum(hertz, 30) / 1000)
        rows = []
        for _ in range(self._items):
            nodes = rng.normal(0, 3.0, 8) + rng.normal(0, 1.5) * np.linspace(-5, 3, 8)
            decibel = np.interp(octaves, np.linspace(-5, 3, 8), nodes)
            if rng.random() < 0.25:
                top = rng.uniform(3000, 7000)
                decibel = decibel - 60 * np.clip(hertz / top - 1, 0, 1) / 0.15
            if rng.random() < 0.25:
                low = rng.uniform(60, 350)
                decibel = decibel - 24 * np.clip(np.log2(low / np.maximum(hertz, 1)), 0, 3)
            response = 10 ** (np.maximum(decibel, -90) / 20)
            rows.append(response * np.fft.rfft(self._room(), size))
        return torch.from_numpy(np.stack(rows).astype(np.complex64))

    def _room(self) -> np.ndarray:
        """Impulse response: the direct sound and a tail of noise that dies away."""
        rng = self.rng
        response = np.zeros(SAMPLE_RATE // 2)
        response[0] = 1
        if rng.random() < 0.45:
            decay = rng.uniform(0.1, 0.6)
            time = np.arange(len(response)) / SAMPLE_RATE
            tail = rng.normal(size=len(response)) * 10 ** (-3 * time / decay)
            tail[: int(rng.uniform(0.002, 0.01) * SAMPLE_RATE)] = 0
            response += tail / np.sqrt((tail**2).sum()) * rng.uniform(0.1, 0.9)
        return response

    def _noise(self, sounds: Tensor, size: int) -> Tensor:
        """Noise of power 1: coloured, or the other items of the batch talking at once, (B, N)."""
        rng = self.rng
        white = torch.from_numpy(rng.standard_normal(sounds.shape, dtype=np.float32))
        slope = torch.from_numpy(rng.uniform(0, 1.2, (len(sounds), 1)).astype(np.float32))
        bins = torch.arange(1, size // 2 + 2, dtype=torch.float32)[None]
        coloured = torch.fft.irfft(torch.fft.rfft(white, size) * bins**-slope, size)
        noise = coloured[:, : sounds.shape[1]]
        babbling = torch.from_numpy(rng.random(len(sounds)) < 0.25)[:, None]
        babble = sum(sounds.roll(int(k), 0) for k in rng.integers(1, len(sounds), 4))
        noise = torch.where(babbling, babble, noise) if len(sounds) > 1 else noise
        return noise / (noise.square().mean(1, keepdim=True).sqrt() + 1e-5)
