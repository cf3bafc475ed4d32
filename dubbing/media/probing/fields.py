"""Detects interlaced video, by flags and images. A frame has two fields of different moments."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import dropwhile, islice
from pathlib import Path

import av
import numpy as np

from dubbing.engine.disk.unchanged import while_unchanged
from dubbing.errors import MediaError
from dubbing.media.opening.opening import opened
from dubbing.media.opening.tracks import pictures

# Frames whose flags are read: so many pixels in all, within bounds.
PIXELS, MIN_FRAMES, MAX_FRAMES = 24 * 1920 * 1080, 8, 48
# Places in a video, and consecutive frames there, whose images are compared.
PLACES, FRAMES = 3, 10
MIN_INTERLACED, MIN_SHARE = 4, 0.7  # interlaced frames, and their share of those with motion
MOVES = 0.02  # of the combing of a still frame: less is no motion
APART = 0.5  # from here on both fields of a frame belong to one moment
UNKNOWN, PROGRESSIVE, TOP_FIRST, BOTTOM_FIRST = range(4)
Video = av.video.stream.VideoStream


@while_unchanged(1024, kept=bool)
def is_flagged(path: Path) -> bool:
    """Whether any frame of a video is flagged as interlaced.

    Raises:
        MediaError: it cannot be read.
    """
    try:
        with opened(path) as container:
            return any(frame.interlaced_frame for frame in _key_frames(container))
    except (av.FFmpegError, IndexError) as error:
        raise MediaError("cannot be decoded", str(path), str(error)) from error


def _key_frames(container: av.container.InputContainer) -> Iterator[av.VideoFrame]:
    """Key frames all over a video, as many as `PIXELS` says; the first where none has a time."""
    video = pictures(container)[0]
    packets = container.demux(video)
    keys = [p.pts for p in packets if p.is_keyframe and p.pts is not None and not p.is_discard]
    count = PIXELS // max(1, video.width * video.height)
    for key in _spread(keys or [video.start_time or 0], min(max(count, MIN_FRAMES), MAX_FRAMES)):
        with suppress(av.FFmpegError):  # damage is reported when the frames are read
            container.seek(key, stream=video)
            packet = next((p for p in container.demux(video) if p.is_keyframe), None)
            # Drained, the decoder does not wait for frames to come.
            frames = packet.decode() or video.decode(None) if packet is not None else []
            yield from (frame for frame in frames if isinstance(frame, av.VideoFrame))


@while_unchanged(1024, kept=bool)
def looks_interlaced(path: Path) -> bool:
    """Whether the images of a video look interlaced, whatever its flags.

    Raises:
        MediaError: it cannot be decoded.
    """
    orders: Counter[int] = Counter()
    try:
        with opened(path) as container:
            video = pictures(container)[0]
            begin, length = container.start_time or 0, container.duration or 0
            for place in range(PLACES):
                container.seek(begin + length * place // PLACES)
                frames = list(islice(_grey(container, video), FRAMES))
                threes = [frames[k : k + 3] for k in range(len(frames) - 2)]
                alike = [three for three in threes if len({f.shape for f in three}) == 1]
                orders.update(order_of(*three) for three in alike)
    except (av.FFmpegError, IndexError) as error:
        raise MediaError("cannot be decoded", str(path), str(error)) from error
    moving = orders.total() - orders[UNKNOWN]
    # Video that repeats every frame looks interlaced as well, but in both orders.
    interlaced = max(orders[TOP_FIRST], orders[BOTTOM_FIRST])
    return interlaced >= max(MIN_INTERLACED, MIN_SHARE * moving)


def order_of(before: np.ndarray, frame: np.ndarray, after: np.ndarray) -> int:
    """The order of the fields of a grey frame, by its neighbours.

    The top field of a progressive frame fits its bottom field better than that of either neighbour.
    Where the bottom field is another moment, it fits one of the neighbours' as well.
    """
    own, early, late = (_combs(frame, bottom) for bottom in (frame, before, after))
    least, most = sorted((early - own, late - own))
    if most < MOVES * own + MOVES:
        return UNKNOWN
    if least > APART * most:
        return PROGRESSIVE
    return TOP_FIRST if early < late else BOTTOM_FIRST


def _combs(top: np.ndarray, bottom: np.ndarray) -> float:
    """Mean difference of lines from their neighbours where fields of two frames are interleaved."""
    rows = min(len(top), len(bottom)) // 2 * 2
    even, odd = top[0:rows:2], bottom[1:rows:2]
    return float(np.abs(2 * odd[:-1] - even[:-1] - even[1:]).mean())


def _grey(container: av.container.InputContainer, video: Video) -> Iterator[np.ndarray]:
    """Grey frames from the position of a container on, every fourth column of them, int16."""
    # Without an index a seek lands anywhere, and nothing can be decoded before a key frame.
    packets = dropwhile(lambda packet: not packet.is_keyframe, container.demux(video))
    for packet in packets:
        for frame in packet.decode():
            if isinstance(frame, av.VideoFrame):
                yield frame.to_ndarray(format="gray")[:, ::4].astype(np.int16)


def _spread(keys: Sequence[int], count: int) -> list[int]:
    """At most `count` keys, evenly spread from the first to the last."""
    if len(keys) <= count:
        return list(keys)
    return [keys[round(k * (len(keys) - 1) / (count - 1))] for k in range(count)]
