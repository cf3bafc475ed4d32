"""The voices of a scene: where each begins, and how loud it is made.

Samples are 48 kHz mono float32.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from dubbing import media
from dubbing.media.loudness import Loudness, measure
from dubbing.script.timeline import Cue

RATE = 48000
# LUFS of every cue: EBU R128; and dialogue for streaming, where a cue is nothing but dialogue.
TARGETS = {"r128": -23.0, "streaming": -27.0}
MOST_PEAK = -2.0  # dBTP
FADE = 240  # samples, 5 ms: where a sound is cut off it must not click


@dataclass(frozen=True)
class Voice:
    """One cue's sound: first sample in the scene, how many there are room for, gain in dB."""

    cue: Cue
    first: int
    room: int
    gain: float

    def samples(self) -> np.ndarray:
        """What is heard, (samples,), at most as many as there is room for.

        Raises:
            MediaError: it cannot be read.
        """
        found = _read(self.cue, self.room) * np.float32(10 ** (self.gain / 20))
        return with_faded_ends(found)


def placed(cues: Sequence[Cue], rate: Fraction, loudness: str) -> list[Voice]:
    """The voices of cues, in the order of their times, with the gain that each needs.

    A gain never lifts true peaks above -2 dBTP. A cue too short or too quiet to be measured takes
    the gain of its speaker's others; where there are none, a short one is measured as if it went
    on.

    Args:
        rate: frames a second of the film.
        loudness: r128, streaming or none.
    """
    edges = [(sample_of(cue.first, rate), sample_of(cue.stop, rate)) for cue in cues]
    gains: list[float | None] = [0.0] * len(cues)
    target = TARGETS.get(loudness)
    if target is not None:
        heard = [
            measured(_padded(_read(c, b - a), b - a)) for c, (a, b) in zip(cues, edges, strict=True)
        ]
        gains = [_gain(found, target) for found in heard]
    known: dict[str, list[float]] = {}
    for cue, gain in zip(cues, gains, strict=True):
        known.setdefault(cue.speaker, []).extend([] if gain is None else [gain])
    found = []
    for cue, (first, stop), gain in zip(cues, edges, gains, strict=True):
        if gain is not None:
            chosen = gain
        elif own := known[cue.speaker]:
            chosen = float(np.median(own))
        else:
            chosen = _gain_alone(cue, stop - first, target)
        found.append(Voice(cue, first, stop - first, chosen))
    return found


def _gain_alone(cue: Cue, room: int, target: float | None) -> float:
    """The gain of a cue too short to be measured; 0 where it is silent."""
    samples = _read(cue, room)
    if target is None or not samples.any():
        return 0.0
    return _gain(measured(np.resize(samples, RATE)), target) or 0.0


def _gain(heard: Loudness, target: float) -> float | None:
    if heard.integrated is None or heard.true_peak is None:
        return None
    return min(target - heard.integrated, MOST_PEAK - heard.true_peak)


def measured(samples: np.ndarray) -> Loudness:
    """Loudness of samples (samples,)."""
    return measure([samples[:, None]], RATE)


def sample_of(frame: int, rate: Fraction) -> int:
    """The first sample of a frame."""
    return round(frame * RATE / rate)


def with_faded_ends(samples: np.ndarray) -> np.ndarray:
    """The same samples, silent at both ends."""
    count = min(FADE, len(samples) // 2)
    ramp = np.linspace(0, 1, count, endpoint=False, dtype=np.float32)
    found = samples.copy()
    found[:count] *= ramp
    found[len(found) - count :] *= ramp[::-1]
    return found


def _padded(samples: np.ndarray, room: int) -> np.ndarray:
    return np.pad(samples, (0, room - len(samples)))


def _read(cue: Cue, room: int) -> np.ndarray:
    path: Path = cue.audio
    found = media.read_audio(path, rate=RATE, start=cue.audio_start, seconds=room / RATE)
    return found[:room]
