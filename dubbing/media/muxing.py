"""Picture and sound into one file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import ffmpeg

from dubbing.files import atomic_path
from dubbing.media.ffmpeg import run

AUDIO_CODECS = {
    "aac": {"acodec": "aac", "audio_bitrate": "256k"},
    "pcm": {"acodec": "pcm_s24le"},
    "flac": {"acodec": "flac"},
}


def mux(
    video: Path | str,
    audio_source: Path | str,
    out: Path | str,
    *,
    audio_start: float,
    seconds: float,
    audio_codec: str = "aac",
    audio_rate: int | None = 48000,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Copy the picture of ``video`` and encode ``seconds`` of sound beside it.

    Args:
        video: its pictures are copied as they are.
        audio_source: anything with sound; every channel of it is kept.
        out: the container follows from the suffix.
        audio_start: where in ``audio_source`` to begin, seconds.
        seconds: how much sound.
        audio_codec: ``aac``, ``pcm`` or ``flac``.
        audio_rate: Hz; None keeps the rate of ``audio_source``.
        metadata: tags of the container.

    Raises:
        MediaError: ffmpeg failed.
    """
    picture = ffmpeg.input(str(video)).video
    sound = ffmpeg.input(str(audio_source), ss=f"{audio_start:.6f}").audio
    # Sound that begins late in its file is padded, so that it keeps its place.
    sound = sound.filter("aresample", **{"async": 1, "first_pts": 0})
    if audio_rate is not None:
        sound = sound.filter("aresample", audio_rate)
    sound = sound.filter("atrim", end=f"{seconds:.6f}")
    tags = {
        f"metadata:g:{k}": f"{key}={text}" for k, (key, text) in enumerate((metadata or {}).items())
    }
    with atomic_path(Path(out)) as temporary:
        options = {"movflags": "+faststart"} if temporary.suffix in (".mp4", ".mov") else {}
        graph = ffmpeg.output(
            picture,
            sound,
            str(temporary),
            vcodec="copy",
            map_metadata=-1,
            fflags="+bitexact",
            **AUDIO_CODECS[audio_codec],
            **options,
            **tags,
        )
        run(graph, str(out))
