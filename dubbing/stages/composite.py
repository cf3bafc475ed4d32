"""The video stage: heads onto backgrounds, the mark, the encoder, the sound, and a last check.

Frames stream from the decoders through the compositor to the encoder, in segments of their own
files, so memory does not grow with the length and a kill costs one segment. S side of the crop.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from dubbing import media, timeline
from dubbing.compositing.composite import blend, replacement
from dubbing.errors import RenderingError
from dubbing.media.overlap import ahead, behind
from dubbing.preparation.prepared import PreparedClip
from dubbing.provenance import provenance
from dubbing.provenance.mark import Mark
from dubbing.provenance.mark_key import Marking, bits_of

SEGMENT = 250  # frames a file
BACKWARDS = 25  # frames decoded forwards and kept, to be given out in reverse
# Containers with exact time stamps, to be joined without decoding.
SEGMENT_SUFFIX = {"h264": ".mov", "prores": ".mov", "ffv1": ".nut"}
TOLERANCE = 1e-3  # seconds; Matroska counts whole milliseconds

# Image, matte, background of the crop, and the full frame where it is asked for.
Source = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]


@dataclass(frozen=True)
class VideoSettings:
    """How a dub is put together; see the manifest."""

    frame: str = "full"
    label: bool = True
    mark: Marking | None = None
    codec: str = "h264"
    audio_rate: int | None = 48000
    audio_start: float = 0.0
    seconds: float = 0.0


def make(
    heads: Path,
    clip: PreparedClip,
    audio: Path,
    out: Path,
    *,
    pose_index: np.ndarray,
    settings: VideoSettings,
    progress: Callable[[str, float], None],
) -> Path:
    """Write OUT/video.<suffix>: composited, marked, encoded, with its sound; checked by decoding.

    Args:
        heads: FFV1 RGBA segments, in the order of the dub.
        clip: whose frames lie under the heads.
        audio: where the sound comes from.
        pose_index: (F,) frame of the clip under every frame of the dub.

    Raises:
        MediaError: a file broke off, or ffmpeg failed.
        RenderingError: fewer heads than frames, or the finished file is not what it should be.
    """
    result = out / f"video{media.SUFFIX[settings.codec]}"
    segments = out / "segments"
    frames = len(pose_index)
    if not result.exists():
        parts = []
        for first in range(0, frames, SEGMENT):
            poses = pose_index[first : first + SEGMENT]
            part = segments / f"{first:06d}{SEGMENT_SUFFIX[settings.codec]}"
            parts.append((part, len(poses) / clip.rate))
            if not part.exists():
                posed_heads = zip(read_heads(heads, first, len(poses)), poses, strict=True)
                pictures = zip(read_source(clip, poses, settings.frame), posed_heads, strict=True)
                draw = Composer(clip, settings)
                width, height = draw.size
                encoder = media.VideoWriter(part, width, height, clip.rate, settings.codec)
                with encoder, behind(encoder.write) as write, closing(ahead(pictures)) as ready:
                    for done, (source, (head, index)) in enumerate(ready, first):
                        write(draw.frame(source, head, int(index)))
                        progress("compositing", done / frames)
        progress("muxing", 1.0)
        # The sound is as long as it was asked for, unless the dub was cut to the clip.
        longest = float((frames + Fraction(1, 2)) / clip.rate)
        media.mux(
            parts,
            audio,
            result,
            audio_start=settings.audio_start,
            seconds=min(settings.seconds, longest),
            audio_codec=media.SOUND[settings.codec],
            audio_rate=settings.audio_rate,
            metadata=provenance.tags(),
        )
    verify(result, frames, clip.rate)
    shutil.rmtree(segments, ignore_errors=True)
    return result


class Composer:
    """Makes the finished frames of one dub."""

    def __init__(self, clip: PreparedClip, settings: VideoSettings) -> None:
        self.clip = clip
        self.full = settings.frame == "full"
        self.size = clip.source_size if self.full else (clip.size, clip.size)
        self.label = provenance.Label(*self.size) if settings.label else None
        self.mark = invisible_mark(settings.mark, *self.size)

    def frame(self, source: Source, head: np.ndarray, index: int) -> np.ndarray:
        """Frame of the dub over frame ``index`` of the clip; uint8 RGB of ``size``.

        A frame without a face stays as it is (but for the label).
        """
        image, matte, background, whole = source
        out = image if whole is None else whole
        if self.clip.valid[index]:
            landmarks = self.clip.landmarks[index]
            picture, mask = replacement(image, matte, background, head, landmarks)
            if whole is None:
                out = blend(image, picture, mask)
            else:
                out = self.clip.paste(whole, index, picture, mask)
            if self.mark is not None:
                crop = (0.0, 0.0, float(self.clip.size))
                out = self.mark.draw(out, [tuple(self.clip.crop[index]) if self.full else crop])
        return self.label.draw(out) if self.label else out


def invisible_mark(marking: Marking | None, width: int, height: int) -> Mark | None:
    """What draws the invisible mark on frames of one size, where there is to be one."""
    if marking is None:
        return None
    return Mark(marking.key(), bits_of(marking.id), width, height)


def read_source(clip: PreparedClip, poses: np.ndarray, frame: str) -> Iterator[Source]:
    """Crop, matte, background (and the full frame) for every pose, whichever way they run."""
    for first, length, step in timeline.runs(poses):
        if step == 0:
            (still,) = _forward(clip, first, 1, frame)
            yield from (still for _ in range(length))
        elif step == 1:
            yield from _forward(clip, first, length, frame)
        else:
            for done in range(0, length, BACKWARDS):
                count = min(BACKWARDS, length - done)
                last = first - done
                yield from reversed(list(_forward(clip, last - count + 1, count, frame)))


def _forward(clip: PreparedClip, first: int, count: int, frame: str) -> Iterator[Source]:
    for *crop, whole in clip.whole_frames(first, count):
        image, matte, background = crop
        yield image, matte, background, whole if frame == "full" else None


def read_heads(folder: Path, first: int, count: int) -> Iterator[np.ndarray]:
    """Heads (S, S, 4) uint8 of frames first .. first + count; files bear their first frame.

    Raises:
        RenderingError: there are not so many.
    """
    files = sorted((int(path.stem), path) for path in folder.glob("*.mkv"))
    given = 0
    for start, path in files:
        if start + media.probe(path).frames <= first or given == count:
            continue
        skip = max(0, first - start)
        for head in media.read_frames(path, start=skip, count=count - given, pixels="rgba"):
            yield head
            given += 1
    if given < count:
        raise RenderingError(
            f"{given} heads instead of {count} from frame {first} on",
            str(folder),
            "run again with --force render",
        )


def verify(path: Path, frames: int, rate: Fraction) -> None:
    """Decode a finished video: its frames, its rate, and that sound and picture begin together.

    Raises:
        RenderingError: something differs.
    """
    info = media.probe(path)
    found = media.count_frames(path)
    if found != frames:
        raise RenderingError(f"the file holds {found} frames instead of {frames}", path.name)
    if info.rate != rate:
        raise RenderingError(f"the file runs at {info.rate} instead of {rate}", path.name)
    if abs(info.video_start - info.audio_start) > TOLERANCE:
        late = 1000 * (info.audio_start - info.video_start)
        raise RenderingError(f"the sound begins {late:.1f} ms after the picture", path.name)
