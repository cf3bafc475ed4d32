"""The video stage: heads onto the film, the mark, the encoder, the sound, and a last check.

Frames stream from the decoders through the compositor to the encoder, in segments of their own
files, so memory does not grow with the length and a kill costs one segment. S side of the crop.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dubbing import json_records as kept
from dubbing import media, timeline
from dubbing.compositing.composite import blend, replacement
from dubbing.errors import RenderingError
from dubbing.files import atomic_write_json
from dubbing.media.overlap import ahead, behind
from dubbing.mixing.mix import SOUND, mix
from dubbing.preparation.prepared import PreparedClip
from dubbing.provenance import provenance
from dubbing.provenance.mark import Mark
from dubbing.provenance.mark_key import Marking, bits_of
from dubbing.script.timecode import timecode_of
from dubbing.stage_kinds import PROXY_FILE, SCENE_FILE
from dubbing.stages.untouched import compare

SEGMENT = 250  # frames a file
BACKWARDS = 25  # frames decoded forwards and kept, to be given out in reverse
SUFFIX = ".mov"  # a container with exact time stamps and colours, to be joined without decoding
MIXED = "mixed.json"
TOLERANCE = 1e-3  # seconds; Matroska counts whole milliseconds

Picture = TypeVar("Picture")
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


@dataclass(frozen=True)
class Sound:
    """The sound of a dub: so many seconds of a file from ``start`` on."""

    path: Path
    start: float
    seconds: float


@dataclass(frozen=True)
class SceneSound:
    """The sound of a scene, to be mixed; see `dubbing.mixing.mix`."""

    cues: tuple[timeline.Cue, ...]
    music: Path | None
    left: tuple[tuple[int, int], ...]
    loudness: str


@dataclass(frozen=True)
class Heads:
    """Rendered heads of a cue, FFV1 RGBA segments: of frames first .. stop of the dub.

    Over ``clip``, of which every dub has one a person.
    """

    folder: Path
    clip: PreparedClip
    first: int
    stop: int


@dataclass(frozen=True)
class Face:
    """A face in a frame: what it is made of, its head, and how much of it is shown."""

    clip: PreparedClip
    source: Source
    head: np.ndarray
    share: float


def make(
    heads: Sequence[Heads],
    sound: Sound | SceneSound,
    out: Path,
    *,
    pose_index: np.ndarray,
    settings: VideoSettings,
    progress: Callable[[str, float], None],
) -> Path:
    """Write OUT/video.<suffix>: composited, marked, encoded, with its sound; checked by decoding.

    It has the colours of the film, and its timecode. What no browser plays gets OUT/proxy.mp4.

    Frames in which nobody says anything new are the film's own. Of a scene there is also
    OUT/voices.flac, and OUT/scene.json: how loud it is, and what proves that.

    Args:
        heads: of all cues; their clips are of one film.
        pose_index: (F,) frame of the film under every frame of the dub.

    Raises:
        MediaError: a file broke off, or ffmpeg failed.
        RenderingError: fewer heads than frames, or the finished file is not what it should be.
    """
    result = out / f"video{media.SUFFIX[settings.codec]}"
    segments = out / "segments"
    frames, film = len(pose_index), heads[0].clip
    rate = film.rate
    source = media.probe(film.clip)
    composer = Composer(heads, pose_index, settings)
    if not result.exists():
        parts = []
        for first in range(0, frames, SEGMENT):
            stop = min(first + SEGMENT, frames)
            part = segments / f"{first:06d}{SUFFIX}"
            parts.append((part, (stop - first) / rate))
            if not part.exists():
                encoder = media.VideoWriter(
                    part, *composer.size, rate, settings.codec, source.colour
                )
                read = composer.read(first, stop)
                with encoder, behind(encoder.write) as write, closing(ahead(read)) as ready:
                    for done, (image, faces) in enumerate(ready, first):
                        write(composer.frame(image, faces, int(pose_index[done])))
                        progress("compositing", done / frames)
        progress("muxing", 1.0)
        if isinstance(sound, SceneSound):
            figures = mix(
                sound.cues,
                film.clip,
                out,
                music=sound.music,
                left=sound.left,
                loudness=sound.loudness,
            )
            atomic_write_json(out / MIXED, figures)
            sound = Sound(out / SOUND, 0.0, float(frames / rate))
        # The sound is as long as it was asked for, unless the dub was cut to the clip.
        longest = float((frames + Fraction(1, 2)) / rate)
        media.mux(
            parts,
            sound.path,
            result,
            audio_start=sound.start,
            seconds=min(sound.seconds, longest),
            audio_codec=media.SOUND[settings.codec],
            audio_rate=settings.audio_rate,
            metadata=provenance.tags(),
            timecode=timecode_at(source, int(pose_index[0])),
        )
    verify(result, frames, rate)
    if settings.codec != "h264":
        progress("proxy", 1.0)
        media.proxy(result, out / PROXY_FILE, provenance.tags())
    if (out / MIXED).is_file():
        own = composer.untouched()
        proof = compare(film.clip, result, own, rate) if own.any() else None
        figures = kept.read(out / MIXED, dict[str, Any], "figures of the mix")
        atomic_write_json(out / SCENE_FILE, {"sound": figures, "untouched": proof})
        (out / SOUND).unlink(missing_ok=True)
        (out / MIXED).unlink()
    shutil.rmtree(segments, ignore_errors=True)
    return result


def timecode_at(film: media.MediaInfo, frame: int) -> str:
    """The timecode of a frame of a film; '' where the film has none."""
    if not film.timecode or film.rate is None:
        return ""
    return timecode_of(film.first_frame + frame, film.rate, drop=";" in film.timecode)


class Composer:
    """Makes the finished frames of one dub.

    Args:
        heads, pose_index: see `make`.
    """

    def __init__(
        self, heads: Sequence[Heads], pose_index: np.ndarray, settings: VideoSettings
    ) -> None:
        self.poses = pose_index
        self.film = film = heads[0].clip
        self.frames = settings.frame
        self.size = film.source_size if self.frames == "full" else (film.size, film.size)
        self.label = provenance.Label(*self.size) if settings.label else None
        self.mark = invisible_mark(settings.mark, *self.size)
        count = len(pose_index)  # a dub that was cut is shorter than its cue
        self.heads = [replace(h, stop=min(h.stop, count)) for h in heads if h.first < count]
        self.shares = {
            h.clip.folder: timeline.shares(self._said(h.clip), pose_index, h.clip.segment)
            for h in self.heads
        }

    def _said(self, clip: PreparedClip) -> np.ndarray:
        """Frames (F,) bool in which the face of a clip says something new, and is seen."""
        said = np.zeros(len(self.poses), bool)
        for own in (h for h in self.heads if h.clip.folder == clip.folder):
            said[own.first : own.stop] = True
        return said & clip.valid[self.poses]

    def untouched(self) -> np.ndarray:
        """Frames (F,) bool that are the film's own."""
        own = np.ones(len(self.poses), bool)
        for spoken in self.heads:
            own[spoken.first : spoken.stop] = False
        return own

    def read(self, first: int, stop: int) -> Iterator[tuple[np.ndarray, list[Face]]]:
        """The film's frames (or crops) first .. stop of the dub, and the faces to replace."""
        edges = {edge for h in self.heads for edge in (h.first, h.stop) if first < edge < stop}
        for low, high in pairwise([first, *sorted(edges), stop]):
            spoken = [h for h in self.heads if h.first <= low < h.stop]
            if spoken:
                yield from self._spoken(spoken, low, high)
            else:
                for image in read_film(self.film, self.poses[low:high]):
                    yield image, []

    def _spoken(
        self, heads: list[Heads], low: int, high: int
    ) -> Iterator[tuple[np.ndarray, list[Face]]]:
        poses = self.poses[low:high]
        sources = [read_source(h.clip, poses, self.frames) for h in heads]
        rendered = [read_heads(h.folder, low - h.first, high - low) for h in heads]
        for k in range(low, high):
            faces = [
                Face(h.clip, next(source), next(head), float(self.shares[h.clip.folder][k]))
                for h, source, head in zip(heads, sources, rendered, strict=True)
            ]
            crop, *_, whole = faces[0].source
            yield crop if whole is None else whole, faces

    def frame(self, image: np.ndarray, faces: Sequence[Face], index: int) -> np.ndarray:
        """Frame of the dub over frame ``index`` of the film; uint8 RGB of ``size``.

        One in which nobody says anything new is given back as it came, without the mark.
        """
        out = with_faces(image, faces, index)
        if self.mark is not None:
            full = self.frames == "full"
            places = [
                tuple(f.clip.crop[index]) if full else (0.0, 0.0, float(f.clip.size))
                for f in faces
                if f.share > 0
            ]
            out = self.mark.draw(out, places) if places else out
        return self.label.draw(out) if self.label and faces else out


def with_faces(image: np.ndarray, faces: Sequence[Face], index: int) -> np.ndarray:
    """Frame ``index`` of the film (or its crop) with faces replaced, one after the other."""
    for face in faces:
        if face.share > 0:
            crop, matte, background, whole = face.source
            landmarks = face.clip.landmarks[index]
            picture, mask = replacement(crop, matte, background, face.head, landmarks)
            if face.share < 1:
                mask = (mask * face.share).round().astype(np.uint8)
            if whole is None:
                image = blend(image, picture, mask)
            else:
                image = face.clip.paste(image, index, picture, mask)
    return image


def invisible_mark(marking: Marking | None, width: int, height: int) -> Mark | None:
    """What draws the invisible mark on frames of one size, where there is to be one."""
    if marking is None:
        return None
    return Mark(marking.key(), bits_of(marking.id), width, height)


def read_source(clip: PreparedClip, poses: np.ndarray, frame: str) -> Iterator[Source]:
    """Crop, matte, background (and the full frame) for every pose, whichever way they run."""

    def forward(first: int, count: int) -> Iterator[Source]:
        for image, matte, background, whole in clip.whole_frames(first, count):
            yield image, matte, background, whole if frame == "full" else None

    return _in_order(forward, poses)


def read_film(clip: PreparedClip, poses: np.ndarray) -> Iterator[np.ndarray]:
    """The frames of the film a clip was prepared from, whichever way they run."""
    return _in_order(
        lambda first, count: media.read_frames(clip.clip, start=first, count=count, rate=clip.rate),
        poses,
    )


def _in_order(
    forward: Callable[[int, int], Iterator[Picture]], poses: np.ndarray
) -> Iterator[Picture]:
    """What ``forward`` reads from a first frame on, for every pose, whichever way they run."""
    for first, length, step in timeline.runs(poses):
        if step == 0:
            (still,) = forward(first, 1)
            yield from (still for _ in range(length))
        elif step == 1:
            yield from forward(first, length)
        else:
            for done in range(0, length, BACKWARDS):
                count = min(BACKWARDS, length - done)
                last = first - done
                yield from reversed(list(forward(last - count + 1, count)))


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
