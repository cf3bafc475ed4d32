"""Mixes voices over a bed: the music and effects, or the film's own audio outside of the cues.

C channels of the bed; 48 kHz. Audio is written block by block, whatever its length.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from fractions import Fraction
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from dubbing import media
from dubbing.engine.disk.files import atomic_path
from dubbing.media.writing.loudness import Loudness, limit, measure
from dubbing.mixing.sound import SOUND, VOICES, Sound
from dubbing.mixing.voices import FADE, MAX_PEAK, RATE, TARGETS, Voice, measured, placed, sample_of

BLOCK = 10 * RATE  # samples
STEREO = 2  # channels where neither the film nor the music has a count
# Channels that dialogue goes to, by how many there are; else the third, which is the centre.
FRONT = {1: (0,), 2: (0, 1), 4: (0, 1)}
CENTRE = 2
Spans = Sequence[tuple[int, int]]


def mix(sound: Sound, film: Path, out: Path) -> dict[str, Any]:
    """Write OUT/voices.flac, the new voices only, and OUT/sound.flac, the whole mix.

    The bed is the music and effects; while a person speaks who is not dubbed, it is the film's own
    audio. Without music it is the film's own audio wherever nobody is dubbed.

    Args:
        film: gives the length; it may have no audio.

    Returns:
        Measurements of the result: loudness and true peak of every cue and of the whole.

    Raises:
        MediaError: a file cannot be read.
    """
    info = media.probe(film)
    length = sample_of(info.frames, info.rate)
    loudness = sound.loudness
    voices = placed(sound.cues, info.rate, loudness)
    own = film if info.audio_rate else None
    bed = _Bed(own, sound.music, voices, _samples(sound.left, info.rate))
    speech = _Speech(voices)
    with ExitStack() as stack:
        files = [stack.enter_context(atomic_path(out / name)) for name in (VOICES, SOUND)]
        stem = stack.enter_context(_flac(files[0], 1))
        whole = stack.enter_context(_flac(files[1], bed.channels))
        for first, under in _whole_blocks(bed.blocks(), length, bed.channels):
            voice = speech.block(first, len(under))
            stem.write(voice)
            whole.write(with_dialogue(under, voice))
    level = _measure_file(out / SOUND)
    limited = loudness in TARGETS and level.true_peak is not None and level.true_peak > MAX_PEAK
    if limited:
        limit(out / SOUND, out / SOUND, MAX_PEAK)
        level = _measure_file(out / SOUND)
    return {
        "loudness": loudness,
        "target": TARGETS.get(loudness),
        "integrated": level.integrated,
        "true_peak": level.true_peak,
        "limited": limited,
        "channels": bed.channels,
        "cues": [_cue_figures(voice, out / VOICES) for voice in voices],
    }


def with_dialogue(bed: np.ndarray, voice: np.ndarray) -> np.ndarray:
    """A bed (samples, C) with a voice (samples,) in its centre, as loud as the voice by itself."""
    channels = bed.shape[1]
    to = FRONT.get(channels, (CENTRE,))
    out = bed.copy()
    for channel in to:
        out[:, channel] += voice / np.float32(len(to) ** 0.5)
    return out


def envelope(spans: Spans, first: int, count: int) -> np.ndarray:
    """1 inside spans of samples, 0 outside, float32 (count,) from sample ``first`` on.

    It rises and falls over 5 ms, inside the spans.
    """
    out = np.zeros(count, np.float32)
    at = np.arange(first, first + count)
    for low, high in spans:
        a, b = max(low - first, 0), min(high - first, count)
        if a < b:
            part = at[a:b]
            rise = np.minimum(part - low, high - 1 - part) / FADE
            out[a:b] = np.maximum(out[a:b], np.clip(rise, 0, 1))
    return out


class _Speech:
    """The sum of the voices, block by block; each voice is in memory only while it is heard."""

    def __init__(self, voices: Sequence[Voice]) -> None:
        self.coming = sorted(voices, key=lambda voice: voice.first)
        self.playing: list[tuple[int, np.ndarray]] = []

    def block(self, first: int, count: int) -> np.ndarray:
        """The sum of all voices from sample ``first`` on, float32 (count,)."""
        while self.coming and self.coming[0].first < first + count:
            voice = self.coming.pop(0)
            self.playing.append((voice.first, voice.samples()))
        out = np.zeros(count, np.float32)
        for begin, samples in self.playing:
            a, b = max(begin, first), min(begin + len(samples), first + count)
            if a < b:
                out[a - first : b - first] += samples[a - begin : b - begin]
        self.playing = [(a, s) for a, s in self.playing if a + len(s) > first + count]
        return out


class _Bed:
    """Audio under the voices: the music and effects, or the film's own."""

    def __init__(
        self, film: Path | None, music: Path | None, voices: Sequence[Voice], left: Spans
    ) -> None:
        self.film, self.music = film, music
        self.dubbed = [(v.first, v.first + v.room) for v in voices]
        self.left = left
        under = music or film
        self.channels = (media.probe(under).audio_channels if under else None) or STEREO

    def blocks(self) -> Iterator[np.ndarray]:
        """Its samples (n, C), at most `BLOCK` at a time; it may end early."""
        if self.music is None:
            if self.film is not None:
                for first, own in _numbered(self._read(self.film)):
                    yield own * (1 - envelope(self.dubbed, first, len(own)))[:, None]
            return
        music = self._read(self.music)
        if self.film is None or not self.left:
            yield from music
            return
        own_blocks = self._read(self.film)
        for first, under in _numbered(music):
            own = next(own_blocks, np.zeros((0, self.channels), np.float32))
            own = np.pad(own, ((0, max(0, len(under) - len(own))), (0, 0)))[: len(under)]
            alone = envelope(self.left, first, len(under))
            alone *= 1 - envelope(self.dubbed, first, len(under))
            yield under + alone[:, None] * (own - under)

    def _read(self, path: Path) -> Iterator[np.ndarray]:
        return media.iter_channels(
            path, rate=RATE, channels=self.channels, block_seconds=BLOCK / RATE
        )


def _whole_blocks(
    blocks: Iterable[np.ndarray], length: int, channels: int
) -> Iterator[tuple[int, np.ndarray]]:
    """Blocks with their first samples, cut or padded with silence to a length."""
    silence = repeat(np.zeros((BLOCK, channels), np.float32))
    for first, block in _numbered(chain(blocks, silence)):
        yield first, block[: length - first]
        if first + len(block) >= length:
            return


def _numbered(blocks: Iterable[np.ndarray]) -> Iterator[tuple[int, np.ndarray]]:
    first = 0
    for block in blocks:
        yield first, block
        first += len(block)


def _samples(spans: Spans, rate: Fraction) -> list[tuple[int, int]]:
    return [(sample_of(a, rate), sample_of(b, rate)) for a, b in spans]


def _flac(path: Path, channels: int) -> soundfile.SoundFile:
    """A FLAC file for float samples in -1..1; others are clipped."""
    return soundfile.SoundFile(path, "w", RATE, channels, "PCM_24", format="FLAC")


def _measure_file(path: Path) -> Loudness:
    with soundfile.SoundFile(path) as file:
        return measure(file.blocks(BLOCK, dtype="float32", always_2d=True), RATE)


def _cue_figures(voice: Voice, stem: Path) -> dict[str, Any]:
    """The loudness of a cue, measured in the written file."""
    with soundfile.SoundFile(stem) as file:
        file.seek(voice.first)
        level = measured(file.read(voice.room, dtype="float32"))
    return {
        "cue": voice.cue.name,
        "gain": round(voice.gain, 2),
        "loudness": level.integrated,
        "true_peak": level.true_peak,
    }
