"""The frames of a dub: rendered heads onto the film, with its marks.

F frames, S side of the crop in px.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np

from dubbing import media
from dubbing.compositing.composite import blend, replacement
from dubbing.errors import RenderingError
from dubbing.preparation.prepared import PreparedClip
from dubbing.provenance import card, provenance
from dubbing.provenance.card import CreditsCard
from dubbing.provenance.mark import Mark
from dubbing.provenance.mark_key import Marking, bits_of
from dubbing.script import timeline
from dubbing.stages.own_pixels import OwnPixels, own_pixels

BACKWARDS = 25  # frames decoded forwards and kept, to be given out in reverse

Picture = TypeVar("Picture")
# Image, matte, background of the crop, and the full frame if it is requested.
Source = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]


@dataclass(frozen=True)
class VideoSettings:
    """How a dub is put together; see the manifest."""

    frame: str = "full"
    label: bool = True
    card: CreditsCard | None = None
    mark: Marking | None = None
    codec: str = "h264"
    audio_rate: int | None = 48000


@dataclass(frozen=True)
class Heads:
    """Rendered heads of a cue, FFV1 RGBA segments: of frames first .. stop of the dub.

    Over ``clip``, of which every dub has one a person. ``kept``: (T,) numbers of the reasons why
    its frames keep their own face; see `own_pixels`. ``name``: of the cue.
    """

    folder: Path
    clip: PreparedClip
    first: int
    stop: int
    kept: np.ndarray
    name: str = ""


@dataclass(frozen=True)
class Face:
    """A face in a frame: its source, the rendered head, and the opacity of the head."""

    clip: PreparedClip
    source: Source
    head: np.ndarray
    share: float


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
        self.label = provenance.VisibleMark(*self.size) if settings.label else None
        self.mark = invisible_mark(settings.mark, *self.size)
        count = len(pose_index)  # a dub that was cut is shorter than its cue
        self.heads = [replace(h, stop=min(h.stop, count)) for h in heads if h.first < count]
        self.shares = {
            h.clip.folder: timeline.shares(self._replaced(h.clip), pose_index, h.clip.segment)
            for h in self.heads
        }

    def _replaced(self, clip: PreparedClip) -> np.ndarray:
        """Frames (F,) bool in which the face of a clip has new speech, and is replaced."""
        replaced = np.zeros(len(self.poses), bool)
        for own in (h for h in self.heads if h.clip.folder == clip.folder):
            replaced[own.first : own.stop] = own.kept[self.poses[own.first : own.stop]] == 0
        return replaced

    def own_pixels(self) -> list[OwnPixels]:
        """Where inside of cues the face stays the film's own."""
        return [
            run
            for h in self.heads
            for run in own_pixels(h.name, h.first, h.kept[self.poses[h.first : h.stop]])
        ]

    def untouched(self) -> np.ndarray:
        """Frames (F,) bool that are the film's own."""
        own = np.ones(len(self.poses), bool)
        for cue in self.heads:
            own[cue.first : cue.stop] = False
        return own

    def read(self, first: int, stop: int) -> Iterator[tuple[np.ndarray, list[Face]]]:
        """The film's frames (or crops) first .. stop of the dub, and the faces to replace."""
        edges = {edge for h in self.heads for edge in (h.first, h.stop) if first < edge < stop}
        for low, high in pairwise([first, *sorted(edges), stop]):
            heads = [h for h in self.heads if h.first <= low < h.stop]
            if heads:
                yield from self._with_heads(heads, low, high)
            else:
                for image in read_film(self.film, self.poses[low:high]):
                    yield image, []

    def _with_heads(
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

    def card(self, text: str) -> np.ndarray:
        """A card of credits in the size of the frames, with the invisible mark all over it."""
        out = card.draw(text, *self.size)
        everywhere = (0.0, 0.0, float(max(self.size)))
        return out if self.mark is None else self.mark.draw(out, [everywhere])

    def frame(self, image: np.ndarray, faces: Sequence[Face], index: int) -> np.ndarray:
        """Frame of the dub over frame ``index`` of the film; uint8 RGB of ``size``.

        A frame without new speech is returned unchanged, without the mark.
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
