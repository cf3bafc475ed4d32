"""A prepared clip, the input of all later stages.

T frames, S the side of the crop in px. Pixel coordinates are OpenCV's: (column, row), (0, 0) the
middle of the first pixel. See :class:`PreparedClip`. What plans a dub reads this: images are loaded
late.
"""

from __future__ import annotations

import itertools
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import atomic_path, atomic_write_json
from dubbing.engine.disk.numbered import numbered
from dubbing.errors import ExplainedError, PreparationError
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER, RIGID
from dubbing.face.mouth.mouth_shape import LIPS
from dubbing.media import PixelFormat, Planes, probe, read_frames, read_planes
from dubbing.preparation.file_names import SUMMARY
from dubbing.preparation.film_frame import FilmFrame

VERSION = 14
HEAD_RADIUS = 1.7  # units (10 cm), the largest extent of a head from its origin
TRACK, MATTE, BACKGROUND = "track.npz", "matte.mkv", "background.mkv"
OVERLAY = "overlay.mkv"  # masks of all frames, if something lies over the face in any
# Raised when a file of arrays cannot be read.
UNREADABLE = (EOFError, OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile)


class Version(TypedDict):
    """The key that summaries of every version have."""

    version: int


class Summary(Version):
    """The fields of a prepared clip besides its arrays."""

    clip: str
    rate: Fraction
    frames: int
    part: tuple[int, int]
    size: int
    source_size: tuple[int, int]
    focal: float
    near: float
    far: float
    residual_shift: float
    warnings: list[str]
    face_warnings: list[str]


@dataclass(frozen=True)
class PreparedClip:
    """Poses, crop, matte and restored background of a clip.

    Attributes:
        folder: where the files lie.
        clip: the source video. rate: frames a second. frames_count: T.
        part: frames first .. stop were prepared. The others show no face, and only `whole_frames`
            has them.
        size: S, side of the crop in px. source_size: (W, H) of the source in px.
        focal: px of the crop, the same in every frame.
        near, far: bounds of the head along the rays, in units of 10 cm.
        warnings: what may have gone wrong, in words.
        face_warnings: whose face was taken, where there are several.
        residual_shift: motion of the upper face that remains once the poses are removed, px.
        rotation, translation: (T, 3, 3), (T, 3) OpenCV head pose, X_cam = R X + t, units of 10 cm.
        centre: (T, 2) principal point in px of the crop: one camera of the full frame, seen
            through a moving window.
        crop: (T, 4) window in px of the source, see `cropping`.
        valid: (T,) the head is seen, and its pose is known. detected: (T,) its landmarks are known,
            too: a head in profile may have none. covered: (T,) something lies before its mouth.
        over: (T,) something lies over a part of the face, as the overlay shows.
        segment: (T,) number of the shot. shown: (T,) share of the frame that is of that shot; less
            than 1 in a dissolve. haze: (T, 3) grey levels of light over the image. noise: (T, 5) of
            the film's pixels, see `film_noise`.
        landmarks: (T, 478, 2) px of the crop; those of a turned head are of the face that was
            detected, seen from the head's pose, and of the mean face where none was detected.
        lip_shift: (T, 40, 2) px from the outer and inner lips of these to where speech had them.
        overlay: file of the masks of what lies over the face, of every frame if over any.
        shape: (478, 3) mean head shape in the head frame: x right, y down, z away from the camera,
            outer eye corners 0.9 apart, origin between the ears.
        jaw: (T, K) px by which the film's jaw line lies beyond the learned head's; see
            `compositing.jaw_line.beside`. grade: (T, 3) of the film beside the head, see
            `compositing.grade`. lip_colour: (T, 3), the same of its lips, see
            `compositing.lip_colour`. None of a film that it was not compared with.
    """

    folder: Path
    clip: Path
    rate: Fraction
    frames_count: int
    part: tuple[int, int]
    size: int
    source_size: tuple[int, int]
    focal: float
    near: float
    far: float
    warnings: list[str]
    face_warnings: list[str]
    residual_shift: float
    rotation: np.ndarray
    translation: np.ndarray
    centre: np.ndarray
    crop: np.ndarray
    valid: np.ndarray
    detected: np.ndarray
    covered: np.ndarray
    over: np.ndarray
    segment: np.ndarray
    shown: np.ndarray
    haze: np.ndarray
    noise: np.ndarray
    landmarks: np.ndarray
    lip_shift: np.ndarray
    shape: np.ndarray
    overlay: Path | None = None
    jaw: np.ndarray | None = None
    grade: np.ndarray | None = None
    lip_colour: np.ndarray | None = None

    def __len__(self) -> int:
        return self.frames_count

    @staticmethod
    def load(folder: Path | str, clip: Path | None = None) -> PreparedClip:
        """Read what :meth:`save` wrote.

        Args:
            clip: the source video, if it was moved since.

        Raises:
            PreparationError: a file is missing or of another version.
        """
        folder = Path(folder)
        try:
            version = json_records.read(folder / SUMMARY, Version, "summary")["version"]
            if version == VERSION:
                summary: Any = json_records.read(folder / SUMMARY, Summary, "summary")
                with np.load(folder / TRACK, allow_pickle=False) as stored:
                    arrays = {name: stored[name] for name in ARRAYS}
        except (ExplainedError, *UNREADABLE) as error:
            raise PreparationError(
                f"not a prepared clip: {error}", str(folder), "run `dfrf prepare` again"
            ) from error
        if version != VERSION:
            raise PreparationError(
                f"prepared by version {version}, this is version {VERSION}",
                str(folder),
                "run `dfrf prepare` again",
            )
        clip = clip or Path(summary["clip"])
        named = {name: summary[name] for name in FIELDS}
        first, stop = summary["part"]
        count, rate = stop - first, summary["rate"]
        own = PreparedClip(folder, clip, rate, count, (0, count), **named, **arrays)
        return own.within(first, summary["frames"])

    def save(self) -> None:
        """Write the track, then the summary: a folder with a summary is complete."""
        with atomic_path(self.folder / TRACK) as temporary:
            own = slice(*self.part)
            arrays = {n: getattr(self, n)[own] for n in ARRAYS} | {"shape": self.shape}
            arrays["segment"] = arrays["segment"] - arrays["segment"][0]
            np.savez_compressed(temporary, allow_pickle=False, **arrays)
        summary: dict[str, Any] = {
            "version": VERSION,
            "clip": str(self.clip),
            "rate": str(self.rate),
            "frames": self.frames_count,
            "part": self.part,
            **{name: getattr(self, name) for name in FIELDS},
        }
        atomic_write_json(self.folder / SUMMARY, summary)

    def within(self, first: int, frames: int) -> PreparedClip:
        """The same as a part of a clip of so many frames; each side of it is a shot of its own.

        Args:
            first: frame of the clip at which it begins.
        """
        every, stop = np.arange(frames), first + len(self)
        inside, own = (every >= first) & (every < stop), np.clip(every - first, 0, len(self) - 1)
        wider: dict[str, Any] = {}
        for name in (name for name in ARRAYS if name != "shape"):
            values = getattr(self, name)[own]
            wider[name] = values & inside if values.dtype == bool else values
        wider["segment"] += ((every >= first) & (first > 0)).astype(int) + (every >= stop)
        return replace(self, frames_count=frames, part=(first, stop), **wider)

    def c2w(self) -> np.ndarray:
        """Camera-to-world (T, 3, 4) float64 in the head frame, OpenGL axes in both.

        Camera: x right, y up, z back. World: head-fixed, y up, the face looks along +z. With
        W = diag(1, -1, -1): R_c2w = W R^T W and o = -W R^T t.
        """
        flip = np.diag([1.0, -1.0, -1.0])
        back = flip @ self.rotation.transpose(0, 2, 1)
        origin = -back @ self.translation[..., None]
        return np.concatenate((back @ flip, origin), axis=2)

    def frontal_landmarks(self) -> np.ndarray:
        """Landmarks as they are seen from the front, (T, 478, 2): x right, y down, head units.

        Each lies as far from the camera as the mean shape does.
        """
        depth = (self.shape @ self.rotation.transpose(0, 2, 1))[..., 2] + self.translation[:, 2:]
        rays = (self.landmarks - self.centre[:, None]) / self.focal
        seen = np.concatenate([rays, np.ones_like(rays[..., :1])], 2) * depth[..., None]
        turned = (seen - self.translation[:, None]) @ self.rotation
        return np.asarray(turned[..., :2])

    def spoken(self) -> PreparedClip:
        """The same clip with lips as speech had them: what a person says is learned from these.

        Those of `landmarks` are beside what is usual from a side, for comparing mouths.
        """
        landmarks = self.landmarks.copy()
        landmarks[:, LIPS] += self.lip_shift
        return replace(self, landmarks=landmarks)

    def eye_distances(self) -> np.ndarray:
        """Distance of the outer corners of the eyes (T,) px, as if the head faced the camera."""
        corners = self.shape[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]]
        depth = (corners @ self.rotation.transpose(0, 2, 1))[..., 2].mean(1) + self.translation[
            :, 2
        ]
        apart = float(np.linalg.norm(corners[0] - corners[1]))
        return np.asarray(self.focal * apart / depth)

    def with_poses(self, c2w: np.ndarray) -> PreparedClip:
        """The same clip with other poses, given as :meth:`c2w` gives them, (T, 3, 4)."""
        flip = np.diag([1.0, -1.0, -1.0])
        towards = flip @ c2w[:, :, :3].transpose(0, 2, 1)
        rotation = towards @ flip
        return replace(self, rotation=rotation, translation=-(towards @ c2w[:, :, 3:])[..., 0])

    def frames(
        self, start: int = 0, count: int | None = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Crops one by one: image (S, S, 3), matte (S, S), background (S, S, 3), all uint8.

        The background equals the image bit for bit outside of the matte's inpaint mask.
        """
        for frame in self.film_frames(start, count):
            yield frame.image, frame.matte, frame.background

    def whole_frames(self, start: int = 0, count: int | None = None) -> Iterator[np.ndarray]:
        """Frames (H, W, 3) uint8 of the source, one by one."""
        return read_frames(self.clip, start=start, count=count, rate=self.rate)

    @property
    def pixels(self) -> PixelFormat | None:
        """Format of the film's own values; None where its frames are RGB pictures alone."""
        return None if numbered(self.clip) else probe(self.clip).pixels

    def whole_planes(self, start: int = 0, count: int | None = None) -> Iterator[Planes]:
        """The same frames in the film's own values."""
        return read_planes(self.clip, start=start, count=count, rate=self.rate)

    def film_frames(self, start: int = 0, count: int | None = None) -> Iterator[FilmFrame]:
        """Frames with all that belongs to them, one by one; the video is decoded once."""
        from dubbing.preparation.tracking import cropping

        images = self.whole_frames(start, count)
        mattes = self.own_frames(self.folder / MATTE, start, count, "gray")
        fills = self.own_frames(self.folder / BACKGROUND, start, count)
        overlays: Iterable[np.ndarray | None] = itertools.repeat(None)
        if self.over[start:].any():
            masks = self.overlay or self.folder / OVERLAY
            overlays = self.own_frames(masks, start, count, "gray")
        motions = self.motions(start, count)
        for index, (whole, matte, fill, overlay) in enumerate(
            zip(images, mattes, fills, overlays, strict=False), start
        ):
            image = cropping.crop(whole, self.crop[index], self.size)
            yield FilmFrame(
                image,
                matte,
                fill,
                overlay if self.over[index] else None,
                self.haze[index],
                self.noise[index],
                motions[index - start],
                self.landmarks[index],
                whole,
                *(None if of is None else of[index] for of in (self.jaw, self.grade)),
            )

    def own_frames(
        self, file: Path, start: int, count: int | None, pixels: str = "rgb24"
    ) -> Iterator[np.ndarray]:
        """Frames of a file that holds those of the part alone; the others are black."""
        first, stop = self.part
        end = len(self) if count is None else min(start + count, len(self))
        low, high = (min(max(at, first), stop) for at in (start, end))
        blank = np.zeros((self.size,) * 2 + (3,) * (pixels == "rgb24"), np.uint8)
        yield from itertools.repeat(blank, min(first, end) - min(start, first))
        if low < high:
            yield from read_frames(file, start=low - first, count=high - low, pixels=pixels)
        yield from itertools.repeat(blank, max(stop, end) - max(start, stop))

    def motions(self, start: int, count: int | None = None) -> np.ndarray:
        """How far the head moves in each of some frames, (F, 2) px of the crop."""
        stop = len(self) if count is None else min(start + count, len(self))
        middles = self.landmarks[:, list(RIGID)].mean(1) + self.crop[:, :2] * (
            self.size / self.crop[:, 2:3]
        )
        index = np.arange(start, stop)
        before, after = np.maximum(index - 1, 0), np.minimum(index + 1, len(self) - 1)
        before = np.where(self.segment[before] == self.segment[index], before, index)
        after = np.where(self.segment[after] == self.segment[index], after, index)
        apart = np.maximum(after - before, 1)[:, None]
        return np.asarray((middles[after] - middles[before]) / apart)

    def paste(
        self, frame: np.ndarray, index: int, crop_image: np.ndarray, mask: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Source frame ``index`` with a crop image pasted in, and the mask; see `paste`."""
        from dubbing.preparation.tracking import cropping

        return cropping.paste(frame, self.crop[index], crop_image, mask)


# Fields that a summary holds under their names, and arrays of the track.
FIELDS = [
    n for n in Summary.__annotations__ if n not in ("version", "clip", "rate", "frames", "part")
]
ARRAYS = [field.name for field in fields(PreparedClip) if field.type == "np.ndarray"]
