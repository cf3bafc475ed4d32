"""The source of a dub on the page: the film, or a copy of one that no browser plays."""

from pathlib import Path
from typing import Any

import av

from dubbing import media
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import make_folder, seen_from
from dubbing.engine.disk.numbered import is_there
from dubbing.errors import ExplainedError
from dubbing.media.opening.opening import opened
from dubbing.media.opening.tracks import pictures
from dubbing.production.production import Production

PROXIES = "sources"  # folder of copies, in that of the stages
CONTAINERS = (".mp4", ".m4v", ".mov", ".webm")
# What browsers show, by codec: formats of pixels.
EIGHT_BITS = ("yuv420p", "yuvj420p")
PLAYED = {
    "h264": EIGHT_BITS,
    "vp8": EIGHT_BITS,
    "vp9": (*EIGHT_BITS, "yuv420p10le"),
    "av1": (*EIGHT_BITS, "yuv420p10le"),
}
HEARD = ("aac", "mp3", "mp3float", "opus", "vorbis", "flac")


def is_played(film: Path) -> bool:
    """Whether browsers show a film's picture; of ProRes they play the sound before a black one.

    And whether they play its sound: none of PCM, as cameras write it, and of several tracks one. Of
    a film that is shown in another colour space than its own they are not asked to.
    """
    if film.suffix.lower() not in CONTAINERS:
        return False
    try:
        info = media.probe(film)
        if info.values.film:
            return False
        with opened(film) as container:
            picture = pictures(container)[0].codec_context
            tracks = [container.streams.audio[k].codec_context for k in info.audio_tracks]
            heard = len(tracks) < 2 and all(track.name in HEARD for track in tracks)
            return heard and picture.pix_fmt in PLAYED.get(picture.name, ())
    except (av.FFmpegError, ExplainedError, LookupError):
        return False


def proxy_of(film: Path, work: Path) -> Path | None:
    """A small H.264 copy of a film below the folder of the stages; None of one that is damaged."""
    path = work / PROXIES / f"{digest_of(film)[:16]}.mp4"
    if not path.is_file():
        try:
            make_folder(path.parent)
            media.proxy(film, path, {})
        except ExplainedError:
            return None
    return path


def source_of(production: Production, film: Path, start: float) -> dict[str, Any]:
    """The film under a dub, for the page; or a copy of it, where no browser plays it."""
    source: Path | None = film if is_there(film) else None
    if source is not None and not is_played(film):
        source = proxy_of(film, production.work)
    return {"source": relative(production, source) if source else None, "source_start": start}


def shown(production: Production, path: Path) -> str:
    """A path as the report names it: relative to its folder where that is near, or its name."""
    near = path.is_relative_to(production.output.parent)
    return relative(production, path) if near else path.name


def relative(production: Production, path: Path) -> str:
    """The way from the page to a file, which may lie elsewhere."""
    return seen_from(production.output, path)
