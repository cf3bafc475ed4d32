"""The frames of a dub: rendered heads onto the film, with its marks.

F frames, S side of the crop in px.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

from dubbing import media
from dubbing.compositing.composite import blend, replacement
from dubbing.compositing.film_look import with_noise
from dubbing.media import Planes
from dubbing.media.properties.colour import Colour
from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking import cropping
from dubbing.preparation.tracking.reach import Reach
from dubbing.provenance import card, provenance
from dubbing.provenance.mark import Mark
from dubbing.provenance.mark_key import Marking, bits_of
from dubbing.script import timeline
from dubbing.video import motion
from dubbing.video.film import in_order, read_film, read_frames
from dubbing.video.heads import Face, Heads
from dubbing.video.own_pixels import ASKED, OVERLAID, OwnPixels, own_pixels, reach
from dubbing.video.settings import VideoSettings
from dubbing.video.spans import spans
from dubbing.video.turnover import Delivery


class Composer:
    """Makes the finished frames of one dub.

    Attributes:
        delivery: of frames beside the video, where there are to be any.
        colour: of the finished frames: the film's, but in pictures of what a display shows.
        pixels: format of their planes; None of RGB pictures.

    Args:
        heads, pose_index: see `make`.
    """

    def __init__(
        self,
        heads: Sequence[Heads],
        pose_index: np.ndarray,
        settings: VideoSettings,
        delivery: Delivery | None = None,
    ) -> None:
        self.poses = pose_index
        self.delivery = delivery
        self.film = film = heads[0].clip
        self.frames = settings.frame
        self.size = film.source_size if self.frames == "full" else (film.size, film.size)
        info = media.probe(film.clip)
        self.pixels, self.values = film.pixels if self.frames == "full" else None, info.values
        shown = self.pixels is None and self.values.film
        self.colour = Colour() if shown else info.colour
        self.label = provenance.VisibleMark(*self.size) if settings.label else None
        self.mark = invisible_mark(settings.mark, *self.size, film.rate)
        count = len(pose_index)  # a dub that was cut is shorter than its cue
        self.heads = [replace(h, stop=min(h.stop, count)) for h in heads if h.first < count]
        self.shares = {
            h.clip.folder: h.clip.shown[pose_index]
            * timeline.shares(self._replaced(h.clip), pose_index, h.clip.segment)
            for h in self.heads
        }

    def _replaced(self, clip: PreparedClip) -> np.ndarray:
        """Frames (F,) bool in which the face of a clip has new speech, and is replaced."""
        replaced = np.zeros(len(self.poses), bool)
        for own in (h for h in self.heads if h.clip.folder == clip.folder):
            replaced[own.first : own.stop] = own.why_kept(self.poses[own.first : own.stop]) == 0
        return replaced

    def own_pixels(self) -> list[OwnPixels]:
        """Where inside of cues the face stays the film's own."""
        return [
            run
            for h in self.heads
            for run in own_pixels(h.name, h.first, h.why_kept(self.poses[h.first : h.stop]))
        ]

    def overlaid(self) -> list[OwnPixels]:
        """Where inside of cues something lies over a replaced face, and stays over it."""
        found = []
        for h in self.heads:
            poses = self.poses[h.first : h.stop]
            over = (h.clip.over[poses] & (h.why_kept(poses) == 0)).astype(int)
            found += own_pixels(h.name, h.first, over, OVERLAID)
        return found

    def reach(self) -> dict[str, Reach]:
        """How much of each cue is dubbed, by its name; of the frames in which it is to be."""
        found = {}
        for h in self.heads:
            poses = self.poses[h.first : h.stop]
            kept = h.why_kept(poses)
            found[h.name] = reach(h.clip, poses[kept != ASKED], kept[kept != ASKED])
        return found

    def replaced(self) -> tuple[int, int]:
        """First and stop of the longest run of frames in which a face is replaced."""
        shown = np.max([share > 0 for share in self.shares.values()], 0, initial=False)
        return max(spans(shown), key=lambda run: run[1] - run[0], default=(0, 0))

    def made_of(self, first: int, stop: int) -> list[Any]:
        """Plain data on which frames first .. stop depend, beside film and settings."""
        found: list[Any] = [self.poses[first:stop].tolist()]
        found += [share[first:stop].tolist() for share in self.shares.values()]
        for h in self.heads:
            low, high = max(first, h.first), min(stop, h.stop)
            if low < high:
                found.append([h.first, low, high, *h.made_of(low - h.first, high - low)])
        return found

    def untouched(self) -> np.ndarray:
        """Frames (F,) bool that are the film's own."""
        own = np.ones(len(self.poses), bool)
        for cue in self.heads:
            own[cue.first : cue.stop] = False
        return own

    def read(self, first: int, stop: int) -> Iterator[tuple[np.ndarray | None, list[Face]]]:
        """The film's frames (or crops) first .. stop of the dub, and the faces to replace.

        None in place of a frame that stays as its planes are.
        """
        edges = {edge for h in self.heads for edge in (h.first, h.stop) if first < edge < stop}
        for low, high in pairwise([first, *sorted(edges), stop]):
            heads = [h for h in self.heads if h.first <= low < h.stop]
            if heads:
                yield from self._with_heads(heads, low, high)
            elif self.pixels is not None and self.delivery is None:
                yield from itertools.repeat((None, []), high - low)
            else:
                for image in read_film(self.film, self.poses[low:high]):
                    yield image, []

    def _with_heads(
        self, heads: list[Heads], low: int, high: int
    ) -> Iterator[tuple[np.ndarray, list[Face]]]:
        poses = self.poses[low:high]
        films = [read_frames(h.clip, poses) for h in heads]
        rendered = [self._rendered(h, low - h.first, high - h.first) for h in heads]
        for k in range(low, high):
            faces = [
                Face(
                    h.clip,
                    next(film),
                    head,
                    float(self.shares[h.clip.folder][k]),
                    beside,
                )
                for h, film, (head, beside) in zip(heads, films, map(next, rendered), strict=True)
            ]
            film = faces[0].film
            yield film.whole if self.frames == "full" else film.image, faces

    def _rendered(
        self, heads: Heads, first: int, stop: int
    ) -> Iterator[tuple[np.ndarray, motion.Beside]]:
        """Heads first .. stop of a cue, with those beside them where vectors are delivered."""
        if self.delivery is None or self.delivery.whole:
            return zip(heads.read(first, stop - first), itertools.repeat((None, None)))
        return motion.with_those_beside(heads.read, first, stop, heads.stop - heads.first)

    def planes(self, first: int, stop: int) -> Iterator[Planes | None]:
        """The film's own values of frames first .. stop of the dub; None for RGB pictures."""
        if self.pixels is None:
            yield from itertools.repeat(None, stop - first)
        else:
            yield from in_order(self.film.whole_planes, self.poses[first:stop])

    def card(self, text: str) -> np.ndarray | Planes:
        """A card of credits in the size and the values of the frames."""
        picture = card.draw(text, *self.size)
        if self.pixels is None:
            return picture
        black = self.pixels.black(*self.size, self.colour)
        return self.pixels.changed(black, np.zeros_like(picture), picture, self.colour, self.values)

    def frame(
        self,
        planes: Planes | None,
        image: np.ndarray | None,
        faces: Sequence[Face],
        index: int,
        number: int,
    ) -> np.ndarray | Planes:
        """Frame ``number`` of the dub, over frame ``index`` of the film, in the film's own values.

        What is not replaced or marked keeps them. A frame without new speech is returned unchanged,
        without the mark. Head crops and drafts are uint8 RGB.

        Args:
            planes: the film's own values of that frame; None for RGB.
            image: see `read`.
        """
        if image is None:
            assert planes is not None
            return planes
        out, replaced = with_faces(image, faces, index, crops=self.frames != "full")
        if self.mark is not None:
            out = self.mark.draw(out, replaced, number)
        if self.delivery is not None:
            self.delivery.write(index, image, out, replaced, faces)
        if self.label and faces:
            out = self.label.draw(out)
        if self.pixels is None or planes is None:
            return out
        return self.pixels.changed(planes, image, out, self.colour, self.values)


def with_faces(
    image: np.ndarray, faces: Sequence[Face], index: int, *, crops: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Frame ``index`` of the film, or its head crop, with faces replaced, one after the other.

    And how much of each pixel is replaced, (H, W) uint8.
    """
    replaced = np.zeros(image.shape[:2], np.uint8)
    for face in faces:
        if face.share > 0:
            picture, *masks = replacement(face.film, face.head)
            mask, new = ((m * face.share).round().astype(np.uint8) for m in masks)
            if crops:
                image = blend(image, picture, mask)
            else:
                image, mask = face.clip.paste(image, index, picture, mask)
                new = cropping.laid(new, face.clip.crop[index], image.shape[:2])
            image = with_noise(image, new, face.film.noise, index)
            np.maximum(replaced, mask, out=replaced)
    return image, replaced


def invisible_mark(marking: Marking | None, width: int, height: int, rate: Fraction) -> Mark | None:
    """The invisible mark for frames of one size and rate, where there is to be one."""
    if marking is None:
        return None
    return Mark(marking.key(), bits_of(marking.id), width, height, rate)
