"""Coded pictures of a video, and frames that are decoded to see that they can be."""

import hashlib
from fractions import Fraction
from pathlib import Path

import av

from dubbing.errors import MediaError
from dubbing.media.opening.opening import opened
from dubbing.media.probing.probing import probe


def coded_pictures(path: Path | str) -> list[str]:
    """A digest of each coded picture, with what sets up its decoder, in the order of showing.

    Pictures that lean on one another, from a key frame up to the next, decode to the same values
    where all of their digests are the same.

    Raises:
        MediaError: it cannot be read.
    """
    try:
        with opened(path) as container:
            stream = container.streams.video[0]
            begun = hashlib.sha256(stream.codec_context.extradata or b"")
            found = []
            for packet in container.demux(stream):
                if packet.size:
                    digest = begun.copy()
                    digest.update(bytes(packet))
                    shown = packet.dts if packet.pts is None else packet.pts
                    found.append((shown or 0, digest.hexdigest()))
            return [digest for _, digest in sorted(found)]
    except (av.FFmpegError, IndexError) as error:
        raise MediaError("cannot be read", str(path), str(error)) from error


def count_frames(path: Path | str, first: int = 0, stop: int | None = None) -> int:
    """Count the frames of a video by decoding every one, or those of first .. stop.

    Where not all are counted, the video must have a constant rate.

    Raises:
        MediaError: it cannot be decoded.
    """
    try:
        with opened(path) as container:
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            if stop is None or stream.time_base is None:
                return sum(1 for _ in container.decode(stream))
            zero, frame = stream.start_time or 0, 1 / (probe(path).rate * stream.time_base)
            if first:
                container.seek(zero + round((first + Fraction(1, 4)) * frame), stream=stream)
            count = 0
            for picture in container.decode(stream):
                number = round(((picture.pts or 0) - zero) / frame)
                if number >= stop:
                    break
                count += number >= first
            return count
    except (av.FFmpegError, IndexError) as error:
        raise MediaError("cannot be decoded", str(path), str(error)) from error
