"""The source of a dub on the page: the film, or a still of one that no browser plays."""

import os
from pathlib import Path
from typing import Any

import av
from PIL import Image

from dubbing import media
from dubbing.engine.stage import digest_of
from dubbing.errors import DubbingError
from dubbing.files import atomic_path, make_folder, writing
from dubbing.manifest.manifest import Manifest
from dubbing.media.opening import opened
from dubbing.script.timeline import first_frame

STILLS = "stills"  # folder of them, in that of the stages
WIDEST = 640  # px of a still
CONTAINERS = (".mp4", ".m4v", ".mov", ".webm")
# What browsers show, by codec: formats of pixels.
EIGHT_BITS = ("yuv420p", "yuvj420p")
PLAYED = {
    "h264": EIGHT_BITS,
    "vp8": EIGHT_BITS,
    "vp9": (*EIGHT_BITS, "yuv420p10le"),
    "av1": (*EIGHT_BITS, "yuv420p10le"),
}


def is_played(film: Path) -> bool:
    """Whether browsers show a film's picture; of ProRes they play the sound before a black one."""
    if film.suffix.lower() not in CONTAINERS:
        return False
    try:
        with opened(film) as container:
            picture = container.streams.video[0].codec_context
            return picture.pix_fmt in PLAYED.get(picture.name, ())
    except (av.FFmpegError, DubbingError, LookupError):
        return False


def still_of(film: Path, frame: int, work: Path) -> Path | None:
    """A frame of a film as a JPEG below the folder of the stages; None where it cannot be read."""
    path = work / STILLS / f"{digest_of(film)[:16]}-{frame}.jpg"
    if path.is_file():
        return path
    try:
        picture = Image.fromarray(next(iter(media.read_frames(film, start=frame, count=1))))
        picture.thumbnail((WIDEST, WIDEST))
        make_folder(path.parent)
        with atomic_path(path) as temporary, writing(path):
            picture.save(temporary, quality=85)
    except (DubbingError, StopIteration):
        return None
    return path


def source_of(manifest: Manifest, film: Path, start: float) -> dict[str, Any]:
    """The film under a dub, for the page; or a still of it, where no browser plays it."""
    found: dict[str, Any] = {"source": None, "source_start": start, "still": None}
    if not film.is_file():
        return found
    if is_played(film):
        return {**found, "source": relative(manifest, film)}
    info = manifest.media.get(film)
    frame = first_frame(start, info.rate) if info and info.frames else 0
    still = still_of(film, frame, manifest.work)
    return {**found, "still": relative(manifest, still) if still else None}


def shown(manifest: Manifest, path: Path) -> str:
    """A path as the report names it: relative to its folder, if it lies below it or beside it."""
    near = path.is_relative_to(manifest.output.parent)
    return relative(manifest, path) if near else str(path)


def relative(manifest: Manifest, path: Path) -> str:
    """The way from the page to a file, which may lie elsewhere."""
    return Path(os.path.relpath(path, manifest.output)).as_posix()
