"""Other takes of a clip's sound: the same words in another voice, with another microphone.

Letters: N samples at 16 kHz, T steps of 20 ms, D channels, W moments, A = 10 sound steps.
"""

from dataclasses import dataclass

import numpy as np

from dubbing.speech.voice_activity import SAMPLE_RATE
from dubbing.sync.network.channels import SoundChannels
from dubbing.sync.network.embeddings import sound_windows

# Largest change of the speed of another take, in logarithms; pitch and formants change with it.
_FASTEST = 0.12
# Level of the speech over the noise of another take, dB.
_SNR = (5.0, 40.0)
_NODES = 8  # of a microphone's response


@dataclass(frozen=True)
class Take:
    """Channels (T, D) of another recording of a clip; second t of the clip is t / speed here."""

    speed: float
    sound: np.ndarray


def another_take(samples: np.ndarray, channels: SoundChannels, rng: np.random.Generator) -> Take:
    """The same words in another voice, through another microphone and with noise.

    Both kinds of channels come from the same changed samples, as they do in a recording.
    """
    speed = float(np.exp(rng.uniform(-_FASTEST, _FASTEST)))
    count = int(len(samples) / speed)
    plain = np.interp(np.arange(count) * speed, np.arange(len(samples)), samples)
    hertz = np.fft.rfftfreq(count, 1 / SAMPLE_RATE)
    octaves = np.log2(np.maximum(hertz, 30) / 1000)
    decibel = np.interp(octaves, np.linspace(-5, 3, _NODES), rng.normal(0, 3, _NODES))
    sound = np.fft.irfft(np.fft.rfft(plain) * 10 ** (decibel / 20), count)
    white = np.fft.rfft(rng.standard_normal(count))
    noise = np.fft.irfft(white * np.maximum(hertz, 30) ** -rng.uniform(0, 1), count)
    level = float(np.sqrt(np.mean(sound**2) / np.mean(noise**2)))
    sound = sound + noise * level * 10 ** (-rng.uniform(*_SNR) / 20)
    return Take(speed, channels.extract(sound.astype(np.float32)))


def take_windows(take: Take, moments: np.ndarray, tempo: float) -> np.ndarray:
    """`sound_windows` of another take, whose clock runs `speed` times as fast, (W, A, D).

    Args:
        moments: (W,) on the clip's clock, tempo as well.
    """
    return sound_windows(take.sound, moments / take.speed, tempo / take.speed)
