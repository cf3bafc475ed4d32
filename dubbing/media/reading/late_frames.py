"""Frames of a video that are decoded only if they are looked at, and keys of what is in them.

A decoder begins anew at a key frame. So the packets from one to the next, a group, say what all of
its frames show, without being decoded.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from threading import Lock

import av
import numpy as np

from dubbing.media.opening.opening import opened
from dubbing.media.probing.probing import probe
from dubbing.media.reading.reading import read_frames

NEAR = 25  # frames that are rather decoded in vain than begun anew after
# Codecs whose groups, as this tool writes them, depend on nothing before them.
CLOSED = ("h264", "ffv1", "prores", "dnxhd")


@dataclass
class LateFrame:
    """A frame of a video.

    Attributes:
        key: the same for frames that show the same; '' where that is not known before.
        read: gives its pixels.
    """

    key: str
    read: Callable[[], np.ndarray]

    @cached_property
    def image(self) -> np.ndarray:
        """Its pixels (H, W, 3) uint8 RGB."""
        return self.read()


class Reader:
    """Reads frames of a video by their numbers: fastest in their order."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, Lock()
        self._frames, self._next = read_frames(path), 0

    def read(self, number: int) -> np.ndarray:
        """A frame (H, W, 3) uint8 RGB.

        Raises:
            MediaError: the video ends before it.
        """
        with self._lock:
            if not self._next <= number <= self._next + NEAR:
                self._frames, self._next = read_frames(self._path, start=number), number
            while self._next < number:
                next(self._frames)
                self._next += 1
            self._next += 1
            return next(self._frames)


def late_frames(path: Path, *, keyed: bool) -> Iterator[LateFrame]:
    """All frames of a video, in order.

    Args:
        keyed: whether they are to have keys, where its packets say what each shows.

    Raises:
        MediaError: it cannot be read.
    """
    reader, keys = Reader(path), group_keys(path) if keyed else []
    for number in range(probe(path).frames):
        yield LateFrame(keys[number] if keys else "", partial(reader.read, number))


def group_keys(path: Path) -> list[str]:
    """Keys of the frames of a video; none where its packets do not say what each shows."""
    info = probe(path)
    groups: list[list[av.Packet]] = []
    with opened(path) as container:
        video = container.streams.video[0]
        name, header = video.codec_context.name, video.codec_context.extradata or b""
        for packet in container.demux(video):
            if packet.size and packet.is_keyframe:
                groups.append([])
            if packet.size and groups:
                groups[-1].append(packet)
    times = [sorted(packet.pts or 0 for packet in group) for group in groups]
    in_order = [time for group in times for time in group]
    plain = in_order == sorted(set(in_order)) and not info.variable_rate and not info.video_start
    if name not in CLOSED or not plain or len(in_order) != info.frames:
        return []
    keys: list[str] = []
    for group, (begin, *_) in zip(groups, times, strict=True):
        digest = hashlib.blake2b(header, digest_size=16)
        for packet in group:
            digest.update(b"%d %d " % ((packet.pts or 0) - begin, packet.size) + bytes(packet))
        keys += [f"{digest.hexdigest()}-{place}" for place in range(len(group))]
    return keys
