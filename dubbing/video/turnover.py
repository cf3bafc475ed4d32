"""Frames of a dub in the film's own values, for whoever composites it, and the proof of them.

A turnover holds a half-float EXR for every frame in which a face is replaced, in layers: the
replaced colour, premultiplied, with its opacity; how replaced pixels move; the raw head; what lies
in front of it in the film. Laid over the film's frame it gives the finished frame. H x W pixels,
S side of the crop.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from pathlib import Path

import numpy as np
from typing_extensions import TypedDict

from dubbing.engine.disk.files import atomic_path, atomic_write_text
from dubbing.errors import RenderingError
from dubbing.media import probe
from dubbing.media.properties.film_values import STEPS, FilmValues
from dubbing.media.sequences import image_files, sequence
from dubbing.preparation.background.pixels import extent
from dubbing.preparation.tracking import cropping
from dubbing.provenance import provenance
from dubbing.video.heads import Face
from dubbing.video.motion import motion
from dubbing.video.nuke import script

CHANNELS = (  # as EXR sorts
    *("R", "G", "B", "A", "backward.u", "backward.v", "forward.u", "forward.v"),
    *("front.A", "head.R", "head.G", "head.B", "head.A"),
)
CHECKED = "checked.txt"  # a line a frame, until all are made
MOST_STEPS = 1.001  # of a half float, between film with layer and the finished frame
Part = tuple[slice, slice]


class Delivered(TypedDict):
    """The outcome of the check of the frames that are delivered.

    Attributes:
        frames: how many files. outside: pixels that changed where opacity is 0.
        steps: largest difference of the film under the layer from the finished frame, in steps of a
            half float. seconds: for a frame.
    """

    frames: int
    outside: int
    steps: float
    seconds: float


@dataclass(frozen=True)
class Delivery:
    """The frames of a dub that are delivered beside its video.

    Attributes:
        film: an image sequence. folder: for the frames.
        whole: whether they are whole frames in the film's format, instead of a turnover.
    """

    film: Path
    folder: Path
    whole: bool

    def write(
        self,
        index: int,
        before: np.ndarray,
        after: np.ndarray,
        replaced: np.ndarray,
        faces: Sequence[Face],
    ) -> None:
        """Write frame ``index`` of the film, with faces.

        Args:
            before, after: its display picture (H, W, 3), as filmed and finished.
            replaced: (H, W) uint8, by how much of 255.
        """
        started = time.perf_counter()
        image = sequence.read(self.film, index)
        name = image.path.name if self.whole else f"{image.path.stem}.exr"
        if not replaced.any():
            if self.whole:
                with atomic_path(self.folder / name) as temporary:
                    shutil.copyfile(image.path, temporary)
                self._note(name, 0, 0.0, started)
            return
        differs = differing(before, after)
        outside = int((differs & (replaced == 0)).sum())
        shown = [face for face in faces if face.share > 0]
        heads = [layer(before, face, index, face.head) for face in shown]
        drawn = reduce(np.maximum, [head[..., 3] for head in heads])
        part = extent((replaced > 0) | (not self.whole and drawn > 0))
        filmed = image.values(part)
        values = probe(self.film).values
        made = values.changed(filmed, before[part], after[part])
        if self.whole:
            stored = image.with_values(made, differs[part], part)
            image_files.write_image(self.folder / name, stored, image.header, tags=tags())
            self._note(name, outside, 0.0, started)
            return
        opacity = (replaced[part].astype(np.float32) / STEPS).astype(np.float16)[..., None]
        rows, columns = part
        corner = columns.start, rows.start
        layers = [premultiplied(made, filmed, opacity), opacity]
        layers += [motion(shown, index, opacity[..., 0] > 0, corner)]
        layers += [in_front(before, faces, index)[part], raw_head(heads, values, part)]
        stored = np.concatenate(layers, 2, dtype=np.float16, casting="same_kind")
        path = self.folder / name
        image_files.write_image(
            path, stored, image.header, channels=CHANNELS, corner=corner, tags=tags()
        )
        written = image_files.read_image(path).stored
        self._note(name, outside, difference(filmed, written[..., :4], made), started)

    def finish(self, rate: Fraction) -> Delivered:
        """Check all frames, and write a script for Nuke that lays a turnover over the film.

        Raises:
            RenderingError: a frame is not what it should be.
        """
        noted = self.folder.parent / CHECKED
        lines = noted.read_text().splitlines() if noted.exists() else []
        of = {name: rest.split() for name, _, rest in (line.partition("\t") for line in lines)}
        found = Delivered(
            frames=len(of),
            outside=sum(int(one[0]) for one in of.values()),
            steps=max((float(one[1]) for one in of.values()), default=0.0),
            seconds=round(sum(float(one[2]) for one in of.values()) / max(1, len(of)), 3),
        )
        if found["outside"] or found["steps"] > MOST_STEPS:
            what = f"{found['outside']} pixels changed outside of the layer, others by"
            raise RenderingError(
                f"{what} {found['steps']:g} half-float steps",
                str(self.folder),
                "run again with --force composite; if that does not help, report it",
            )
        if not self.whole:
            self.folder.mkdir(exist_ok=True)
            atomic_write_text(self.folder / "over_the_film.nk", script(self.film, rate))
        return found

    def _note(self, name: str, outside: int, steps: float, started: float) -> None:
        line = f"{name}\t{outside} {steps:.4f} {time.perf_counter() - started:.4f}\n"
        with LOCK, (self.folder.parent / CHECKED).open("a", encoding="utf-8") as file:
            file.write(line)


LOCK = threading.Lock()  # of the notes: frames are made in several threads


def differing(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool in which two pictures (H, W, 3) differ."""
    one, two, three = (before[..., k] != after[..., k] for k in range(3))
    return one | two | three


def layer(frame: np.ndarray, face: Face, index: int, crop: np.ndarray) -> np.ndarray:
    """A crop (S, S, C) uint8 at its place in frame ``index`` of the film, (H, W, C)."""
    whole = np.full(crop.shape[:2], 255, np.uint8)
    nothing = np.zeros((*frame.shape[:2], crop.shape[2]), np.uint8)
    return cropping.paste(nothing, face.clip.crop[index], crop, whole)[0]


def raw_head(heads: Sequence[np.ndarray], values: FilmValues, part: Part) -> np.ndarray:
    """The heads (H, W, 4) uint8 of a frame, one over the other, in the film's values."""
    head = np.zeros((*heads[0][part].shape[:2], 4), np.float32)
    for over in heads:
        opacity = over[part][..., 3:] / np.float32(STEPS)
        shown = over[part][..., :3] / np.maximum(over[part][..., 3:], 1).astype(np.float32)
        colour = values.of_display(np.clip(shown, 0, 1)) * opacity
        head = np.concatenate([colour, opacity], 2) + (1 - opacity) * head
    return head


def in_front(frame: np.ndarray, faces: Sequence[Face], index: int) -> np.ndarray:
    """Opacity (H, W, 1) float32 of what lies over faces in the film."""
    front = np.zeros((*frame.shape[:2], 1), np.float32)
    for face in faces:
        if face.film.overlay is not None:
            over = layer(frame, face, index, np.stack([face.film.overlay] * 3, 2))
            front = np.maximum(front, over[..., :1] / np.float32(STEPS))
    return front


def premultiplied(made: np.ndarray, filmed: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """The layer (h, w, 3) that gives ``made`` when it is laid over the film with an opacity."""
    return np.where(opacity > 0, made - filmed * (1 - opacity.astype(np.float32)), 0)


def difference(filmed: np.ndarray, written: np.ndarray, made: np.ndarray) -> float:
    """Largest difference of the film under a layer from the finished frame, in half-float steps.

    Args:
        written: (h, w, 4), colour premultiplied by opacity, and opacity.
    """
    over = (written[..., :3] + filmed * (1 - written[..., 3:])).astype(np.float16)
    half = made.astype(np.float16)
    # Rounding is that of the largest number: of a negative value and a positive one, the layer.
    largest = np.maximum(np.maximum(np.abs(made), np.abs(filmed)), np.abs(written[..., :3]))
    step = np.spacing(largest.astype(np.float16))
    apart = np.abs(over.astype(np.float32) - half) / step.astype(np.float32)
    return float(np.nan_to_num(apart).max(initial=0.0))


def tags() -> dict[str, str]:
    """Attributes of every file: what generated it."""
    return {"ImageDescription": provenance.tags()["description"], "Software": provenance.made_by()}
