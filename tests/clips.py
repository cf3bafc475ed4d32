"""Small clips for the tests, made by ffmpeg on the spot."""

from __future__ import annotations

import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import soundfile

from dubbing import media

# Of whoever is on the clips, as a manifest holds it.
CONSENT = '{by: "the person on film", reference: "form 17"}'


def frame(k: int, width: int = 64, height: int = 48) -> np.ndarray:
    """Frame k: a smooth picture, and k in binary as twelve blocks of black or white on top."""
    rows, columns = np.mgrid[0:height, 0:width]
    picture = np.stack([rows * 2, columns * 2, (rows + columns) % 200], axis=-1).astype(np.uint8)
    side = width // 12
    for bit in range(12):
        picture[:side, bit * side : (bit + 1) * side] = 255 * (k >> bit & 1)
    return picture


def number(picture: np.ndarray) -> int:
    """The k of a frame made by ``frame``, whatever the codec did to it."""
    side = picture.shape[1] // 12
    blocks = [picture[: side - 1, b * side + 1 : (b + 1) * side - 1].mean() for b in range(12)]
    return sum((value > 128) << bit for bit, value in enumerate(blocks))


def write_video(
    path: Path,
    frames: int,
    rate: Fraction = Fraction(25),
    *,
    size: tuple[int, int] = (64, 48),
    codec: str = "h264",
    pixels: str = "",
) -> Path:
    """Numbered frames without sound; FFV1 where a format of pixels is given."""
    there = path.with_name(f"rgb_{path.name}") if pixels else path
    with media.VideoWriter(there, *size, rate, "ffv1" if pixels else codec) as writer:
        for k in range(frames):
            writer.write(frame(k, *size))
    if pixels:
        ffmpeg("-i", there, "-c:v", "ffv1", "-pix_fmt", pixels, path)
        there.unlink()
    return path


def tone(seconds: float, rate: int = 16000, channels: int = 1, hertz: float = 220.0) -> np.ndarray:
    """A quiet tone, (samples, channels)."""
    wave = 0.2 * np.sin(2 * np.pi * hertz * np.arange(round(seconds * rate)) / rate)
    return np.repeat(wave[:, None], channels, axis=1).astype(np.float32)


def write_sound(
    path: Path, seconds: float, rate: int = 16000, channels: int = 1, hertz: float = 220.0
) -> Path:
    """A WAV of a tone."""
    soundfile.write(path, tone(seconds, rate, channels, hertz), rate)
    return path


def write_noise(path: Path, seconds: float, rate: int = 48000, seed: int = 0) -> Path:
    """A WAV of noise, of which every stretch is unlike every other."""
    noise = np.random.default_rng(seed).normal(size=round(seconds * rate)) * 0.1
    soundfile.write(path, noise, rate, subtype="PCM_24")
    return path


def lag(heard: np.ndarray, recording: np.ndarray) -> int:
    """By how many samples a sound (N,) comes late in another; where they are most alike."""
    size = len(heard) + len(recording)
    spectra = np.fft.rfft(heard, size) * np.conj(np.fft.rfft(recording, size))
    best = int(np.fft.irfft(spectra, size).argmax())
    return best if best < len(heard) else best - size


def write_clip(
    path: Path,
    frames: int,
    rate: Fraction = Fraction(25),
    *,
    size: tuple[int, int] = (64, 48),
    pixels: str = "",
) -> Path:
    """Numbered frames with a tone as long as they are."""
    silent = path.with_name(f"silent_{path.name}")
    write_video(silent, frames, rate, size=size, pixels=pixels)
    seconds = float(frames / rate)
    sound = write_sound(path.with_name(f"{path.stem}.tone.wav"), seconds)
    media.mux(silent, sound, path, audio_start=0, seconds=seconds)
    silent.unlink()
    sound.unlink()
    return path


def ffmpeg(*arguments: str | Path) -> None:
    """Run ffmpeg on what ``dubbing.media`` would not make."""
    command = [media.binary(), "-y", "-loglevel", "error", *map(str, arguments)]
    subprocess.run(command, check=True)
