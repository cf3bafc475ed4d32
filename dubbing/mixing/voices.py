"""The voices of a scene: start and gain of each.

Samples are 48 kHz mono float32.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from dubbing import media
from dubbing.media.writing.loudness import Loudness, measure
from dubbing.script.timeline import Cue

RATE = 48000
# LUFS of every cue: EBU R128, and dialogue loudness for streaming (a cue is all dialogue).
TARGETS = {"r128": -23.0, "streaming": -27.0}
MAX_PEAK = -2.0  # dBTP
FADE = 240  # samples, 5 ms: audio that is cut off must not click


@dataclass(frozen=True)
class Voice:
    """One cue's audio: first sample in the scene, room for how many samples, gain in dB."""

    cue: Cue
    first: int
    room: int
    gain: float

    def samples(self) -> np.ndarray:
        """The voice with its gain, (samples,), at most as many as there is room for.

        Raises:
            MediaError: it cannot be read.
        """
        return with_faded_ends(_read(self.cue, self.room) * np.float32(10 ** (self.gain / 20)))


def placed(cues: Sequence[Cue], rate: Fraction, loudness: str) -> list[Voice]:
    """The voices of cues, in the order of their times, each with the gain that it needs.

    A gain never lifts true peaks above -2 dBTP. A cue too short or too quiet to be measured takes
    the median gain of its speaker's others. Without others, it is repeated to be measured.

    Args:
        rate: frames a second of the film.
        loudness: r128, streaming or none.
    """
    edges = [(sample_of(cue.first, rate), sample_of(cue.stop, rate)) for cue in cues]
    gains: list[float | None] = [0.0] * len(cues)
    target = TARGETS.get(loudness)
    if target is not None:
        levels = [
            measured(_padded(_read(c, b - a), b - a)) for c, (a, b) in zip(cues, edges, strict=True)
        ]
        gains = [_gain(level, target) for level in levels]
    known: dict[str, list[float]] = {}
    for cue, gain in zip(cues, gains, strict=True):
        known.setdefault(cue.speaker, []).extend([] if gain is None else [gain])
    voices = []
    for cue, (first, stop), gain in zip(cues, edges, gains, strict=True):
        if gain is not None:
            chosen = gain
        elif own := known[cue.speaker]:
            chosen = float(np.median(own))
        else:
            chosen = _gain_of_repeated(cue, stop - first, target)
        voices.append(Voice(cue, first, stop - first, chosen))
    return voices


def _gain_of_repeated(cue: Cue, room: int, target: float | None) -> float:
    """The gain of a cue too short to be measured; 0 where it is silent."""
    samples = _read(cue, room)
    if target is None or not samples.any():
        return 0.0
    return _gain(measured(np.resize(samples, RATE)), target) or 0.0


def _gain(level: Loudness, target: float) -> float | None:
    if level.integrated is None or level.true_peak is None:
        return None
    return min(target - level.integrated, MAX_PEAK - level.true_peak)


def measured(samples: np.ndarray) -> Loudness:
    """Loudness of samples (samples,)."""
    return measure([samples[:, None]], RATE)


def sample_of(frame: int, rate: Fraction) -> int:
    """The first sample of a frame."""
    return round(frame * RATE / rate)


def with_faded_ends(samples: np.ndarray) -> np.ndarray:
    """The same samples, faded in and out."""
    count = min(FADE, len(samples) // 2)
    ramp = np.linspace(0, 1, count, endpoint=False, dtype=np.float32)
    out = samples.copy()
    out[:count] *= ramp
    out[len(out) - count :] *= ramp[::-1]
    return out


def _padded(samples: np.ndarray, room: int) -> np.ndarray:
    return np.pad(samples, (0, room - len(samples)))


def _read(cue: Cue, room: int) -> np.ndarray:
    return media.read_audio(cue.audio, rate=RATE, start=cue.audio_start, seconds=room / RATE)[:room]
