"""Reduces the channels of audio to one with the voice.

Channels are averaged. Where that would cancel the voice (one channel is the other inverted) or
halve it (a channel is silent), only channels with the voice are averaged; of 5.1 and the like it is
the centre. All readers of mono audio use this, so that features, lips, sync check and mix get the
same.

P pieces of half a second, C channels.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from dubbing.engine.disk.unchanged import while_unchanged
from dubbing.errors import MediaError
from dubbing.media.opening.ffmpeg import changing_sound
from dubbing.media.opening.opening import opened
from dubbing.media.properties.info import MediaInfo

PIECE = 0.5  # seconds
# Of audio longer than the first, so many windows are read, each of so many seconds.
WHOLE, WINDOWS, WINDOW = 60.0, 20, 2.0
SILENT = 1e-7  # mean power of a piece: -70 dB of full scale, the gate of loudness measurement
UNUSED = 1e-4  # power of a silent channel over that of the loudest
CENTRAL = 0.25  # power of a centre with dialogue over that of the loudest channel
LOUD = 1e-2  # power of pieces that count over that of the loudest
# Power of the sum of channels over the sum of their powers: C if they are equal, 1 if they are
# uncorrelated, 0 if they cancel. Channels cancel below the first in any loud piece, or below the
# second in all together.
CANCELS, CANCEL_TOGETHER = 0.25, 0.5
Container = av.container.InputContainer


@dataclass(frozen=True)
class VoiceChannel:
    """The channels of a part of a file's audio that are averaged.

    Attributes:
        weights: of the channels.
        why: ``centre``, ``opposed``, ``unused`` or '', why not all of them are averaged.
    """

    weights: tuple[float, ...]
    why: str = ""

    @property
    def taken(self) -> str:
        """The channels that are averaged, counted from 1."""
        return ", ".join(str(k) for k, weight in enumerate(self.weights, 1) if weight)


def voice_channel(info: MediaInfo, start: float, seconds: float | None) -> VoiceChannel:
    """The channels to average in ``seconds`` of audio from ``start`` on.

    Raises:
        MediaError: it cannot be decoded.
    """
    count = info.audio_channels or 1
    if count == 1:
        return VoiceChannel((1.0,))
    known = _known(info.path)
    if (start, seconds) not in known:
        end = info.sound_seconds if seconds is None else min(info.sound_seconds, start + seconds)
        powers = [_powers(part) for part in _pieces(info, start, end)]
        none = np.zeros((0, count, count))
        known[start, seconds] = chosen(np.concatenate([none, *powers]), info.centre)
    return known[start, seconds]


def chosen(powers: np.ndarray, centre: int | None = None) -> VoiceChannel:
    """The channels to average in pieces with the powers (P, C, C) of all pairs.

    Args:
        centre: the channel of dialogue, if the file says which it is.
    """
    count = powers.shape[1]
    every = VoiceChannel((1 / count,) * count)
    own = powers.trace(axis1=1, axis2=2)
    loud = powers[own > LOUD * own.max(initial=0)]
    total = loud.sum(0)
    each = total.diagonal()
    if not len(loud) or each.max() <= 0:
        return every
    used = each > UNUSED * each.max()
    if centre is not None and used.sum() > 1 and each[centre] > CENTRAL * each.max():
        return VoiceChannel(tuple(float(k == centre) for k in range(count)), "centre")
    sums = loud.sum((1, 2)) / loud.trace(axis1=1, axis2=2)
    if sums.min() < CANCELS or total.sum() < CANCEL_TOGETHER * each.sum():
        # The first of those about as loud as the loudest, so that it is the same in all parts.
        used = np.arange(count) == (each > each.max() / 2).argmax()
        return VoiceChannel(tuple(used.astype(float).tolist()), "opposed")
    if used.all():
        return every
    return VoiceChannel(tuple((used / used.sum()).tolist()), "unused")


def are_silent(info: MediaInfo, stretches: Sequence[tuple[float, float]]) -> list[bool]:
    """Whether stretches (start, seconds) of audio are silent.

    Each is read up to its first sound.

    Raises:
        MediaError: it cannot be opened.
    """
    with _opened(info) as container:
        return [_is_silent(info, container, *stretch) for stretch in stretches]


def is_silent(info: MediaInfo, start: float, seconds: float) -> bool:
    """The same of one stretch."""
    return are_silent(info, [(start, seconds)])[0]


def _is_silent(info: MediaInfo, container: Container, start: float, seconds: float) -> bool:
    end, pieces = min(info.sound_seconds, start + seconds), 0
    for part in _decoded(info, container, start, end):
        if part.astype(np.float64).var(0).max() > SILENT:
            return False
        pieces += 1
    # Where none of it can be decoded, reading it reports the error.
    return pieces > 0 or end - start < PIECE


@contextmanager
def _opened(info: MediaInfo) -> Iterator[Container]:
    """A file open to check its audio, in this process: there may be many short recordings."""
    try:
        with opened(info.path, short_packets=True) as container:
            yield container
    except (av.FFmpegError, ValueError) as error:
        raise MediaError("its sound cannot be decoded", str(info.path), str(error)) from error


@while_unchanged(1024)
def _known(_path: Path) -> dict[tuple[float, float | None], VoiceChannel]:
    """A cache of the channels to average in stretches of a file."""
    return {}


def _pieces(info: MediaInfo, start: float, end: float) -> Iterator[np.ndarray]:
    """Pieces (n, C) of a stretch; all of a short one."""
    begins = [start] if end - start <= WHOLE else np.linspace(start, end - WINDOW, WINDOWS)
    length = end - start if end - start <= WHOLE else WINDOW
    with _opened(info) as container:
        for begin in map(float, begins):
            yield from _decoded(info, container, begin, begin + length)


def _powers(part: np.ndarray) -> np.ndarray:
    """Mean power of all pairs of channels, (1, C, C), of a piece (n, C), without its mean.

    A constant offset, as of a cheap converter, cannot be heard.
    """
    exact = part.astype(np.float64) - part.mean(0, dtype=np.float64)
    return (exact.T @ exact / len(part))[None]


def _decoded(
    info: MediaInfo, container: Container, start: float, end: float
) -> Iterator[np.ndarray]:
    """Pieces (n, C) float32 of the tracks that are read, from ``start`` to ``end`` seconds."""
    tracks = [container.streams.audio[k] for k in info.audio_tracks]
    places = {track.index: k for k, track in enumerate(tracks)}
    held: list[list[np.ndarray]] = [[] for _ in tracks]
    zero, rate = container.start_time or 0, info.audio_rate or 1
    begin, length = start + zero / av.time_base, max(1, round(PIECE * rate))
    left = round((end - start) * rate)
    container.seek(zero + int(start * av.time_base))
    for packet in container.demux(tracks):
        with suppress(av.FFmpegError):  # a damaged packet, which ffmpeg skips as well
            for frame in packet.decode():
                if isinstance(frame, av.AudioFrame):
                    own, samples = held[places[packet.stream.index]], _samples(frame, begin)
                    if own and own[0].shape[1] != samples.shape[1]:
                        raise changing_sound(str(info.path))
                    own.append(samples)
        while left > 0 and (ready := min(sum(map(len, own)) for own in held)) >= length:
            yield _taken(held, min(length, left, ready))
            left -= length
        if left <= 0:
            return
    if (ready := min(sum(map(len, own)) for own in held)) > 0:
        yield _taken(held, min(left, ready))


def _taken(held: list[list[np.ndarray]], count: int) -> np.ndarray:
    """Remove the first samples of every track from `held`, and join them, (count, C)."""
    parts = []
    for own in held:
        whole = np.concatenate(own)
        parts.append(whole[:count])
        own[:] = [whole[count:]]
    return np.concatenate(parts, 1)


def _samples(frame: av.AudioFrame, begin: float) -> np.ndarray:
    """Samples (n, C) float32 of a frame from ``begin`` seconds on, full scale 1."""
    samples = frame.to_ndarray()
    samples = samples.T if frame.format.is_planar else samples.reshape(frame.samples, -1)
    early = round((begin - (frame.time or begin)) * frame.sample_rate)
    samples = samples[max(0, early) :]
    if samples.dtype.kind == "f":
        return samples.astype(np.float32)
    middle = 128 if samples.dtype == np.uint8 else 0
    return (samples.astype(np.float32) - middle) / np.float32(2 ** (8 * samples.dtype.itemsize - 1))
