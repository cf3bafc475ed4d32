"""Muxes picture and sound into one file."""

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from fractions import Fraction
from itertools import accumulate, pairwise
from pathlib import Path

from dubbing.engine.disk.files import atomic_path
from dubbing.engine.disk.numbered import numbered
from dubbing.errors import MediaError
from dubbing.media.opening.ffmpeg import run
from dubbing.media.opening.opening import (
    LAYOUTS,
    Stream,
    address,
    in_time,
    into,
    joined,
    picture_of,
    sound_of,
    source,
)
from dubbing.media.probing.probing import probe
from dubbing.media.properties.info import MediaInfo
from dubbing.media.reading.reading import read_frames
from dubbing.media.writing.writing import THREADS, VideoWriter

AUDIO_CODECS = {
    "aac": {"acodec": "aac", "audio_bitrate": "256k"},
    "pcm": {"acodec": "pcm_s24le"},
    "flac": {"acodec": "flac"},
}
# Nothing of an input but its picture or sound, and nothing of this machine.
OWN = {"map_metadata": -1, "map_chapters": -1, "fflags": "+bitexact"}
PROXY_WIDTH = 1280  # px at most
MOST_CHANNELS = {"aac": 8, "pcm": 64, "flac": 8}
SOUND = {  # audio codec for each video codec
    **{"h264": "aac", "hevc": "aac", "ffv1": "flac"},
    **dict.fromkeys(("prores", "prores4444", "dnxhr"), "pcm"),
}


def mux(
    video: Path | str | Sequence[tuple[Path, Fraction]],
    audio_source: Path | str,
    out: Path | str,
    *,
    audio_start: float,
    seconds: float,
    silent_until: float | None = None,
    audio_codec: str = "aac",
    audio_rate: int | None = 48000,
    metadata: Mapping[str, str] | None = None,
    timecode: str = "",
) -> None:
    """Copy the picture of ``video`` and encode ``seconds`` of sound beside it.

    Args:
        video: its picture is copied without encoding. Or several files of one kind, each with its
            exact length in seconds, to be concatenated.
        audio_source: file with sound; every channel of it is kept.
        out: its suffix determines the container.
        audio_start: second of ``audio_source`` to start at.
        seconds: length of the sound.
        silent_until: seconds to which the sound is padded with silence; none by default.
        audio_codec: ``aac``, ``pcm`` or ``flac``.
        audio_rate: Hz; None keeps the rate of ``audio_source``.
        metadata: tags of the container.
        timecode: of the first frame; none by default.

    Raises:
        MediaError: `audio_source` cannot be read, ffmpeg failed, or a part cannot be listed for it.
    """
    audio_info = probe(audio_source)
    sound = sound_of(audio_source, audio_info.zero, audio_start, audio_info.audio_tracks)
    if audio_rate is not None:
        sound = sound.filter("aresample", audio_rate)
    sound = sound.filter("atrim", end=f"{seconds:.6f}")
    if silent_until is not None:
        sound = sound.filter("apad", whole_dur=f"{silent_until:.6f}")
    tags = _tags(metadata or {})
    with ExitStack() as stack:
        temporary = stack.enter_context(atomic_path(Path(out)))
        if isinstance(video, (str, Path)):
            picture, rate = source(video).video, probe(video).rate
        else:
            first, length = video[0]
            rate = probe(first).frames / length
            # A file of our own would be open still: Windows lets nobody else open it then.
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            listing = Path(folder, "parts.txt")
            listing.write_text(concat_list(video), encoding="utf-8", newline="\n")
            picture = joined(listing).video
        if timecode:
            tags["timecode"] = timecode
        options: dict[str, object] = {}
        if temporary.suffix in (".mp4", ".mov"):
            # ffmpeg guesses the bit rate of copied pictures, and not always as the last time.
            options = {"movflags": "+faststart", "write_btrt": 0}
        graph = into(
            temporary,
            picture,
            sound,
            vcodec="copy",
            r=f"{rate}",  # ffmpeg would guess 120 for 120000/1001
            **OWN,
            **AUDIO_CODECS[audio_codec],
            **options,
            **tags,
        )
        run(graph, str(out))


def cut(video: Path, out: Path, first: int, count: int) -> None:
    """Copy the picture of ``count`` frames of an MP4 or MOV from a key frame on, without encoding.

    No frame after them may come before one of them in the file. (Matroska counts whole
    milliseconds: what is cut from it cannot be joined exactly.)

    Raises:
        MediaError: ffmpeg failed.
    """
    begin = (first + Fraction(1, 4)) / probe(video).rate  # a seek ends at the key frame before
    picture = source(video, ss=f"{float(begin):.6f}").video
    with atomic_path(out) as temporary:
        options = {"vcodec": "copy", "frames:v": count, "avoid_negative_ts": "make_zero"}
        run(into(temporary, picture, **OWN, **options), str(out))


def proxy(video: Path, out: Path, metadata: Mapping[str, str]) -> None:
    """A small H.264 copy of a video, which every browser plays: what a display shows of it.

    Raises:
        MediaError: ffmpeg failed.
    """
    info = probe(video)
    colour = info.colour
    encoder = {"vcodec": "libx264", "pix_fmt": "yuv420p", "crf": 23, "preset": "veryfast"}
    audio, channels = [], info.audio_channels
    if channels:
        audio = [_in_stereo(sound_of(video, info.zero, 0.0, info.audio_tracks), channels)]
    # One channel stays one: in two, each would be 3 dB softer.
    sound = {"acodec": "aac", "ac": min(channels, 2), "audio_bitrate": "128k"} if channels else {}
    with tempfile.TemporaryDirectory() as folder, atomic_path(out) as temporary:
        if numbered(video) or info.values.film:
            shown = Path(folder, "shown.mp4")
            _shown(info, shown)
            picture, encoder = source(shown).video, {"vcodec": "copy"}
        else:
            width = f"min({PROXY_WIDTH},trunc(iw/2)*2)"
            picture = (
                in_time(picture_of(video, info.zero, 0.0), info.late)
                .filter("scale", w=width, h=-2, out_color_matrix=colour.matrix, out_range="tv")
                .filter("setparams", **{**colour.tags(), "range": "tv"})
            )
        graph = into(
            temporary,
            picture,
            *audio,
            **sound,
            **OWN,
            movflags="+faststart",
            threads=THREADS,
            **encoder,
            **_tags(metadata),
        )
        run(graph, str(out))


def _shown(info: MediaInfo, out: Path) -> None:
    """The picture of a small copy of what a display shows."""
    import cv2  # which plans do without
    import numpy as np

    width = min(PROXY_WIDTH, info.width) // 2 * 2
    size = width, max(2, round(info.height * width / info.width / 2) * 2)
    with VideoWriter(out, *size, info.rate) as writer:
        for image in read_frames(info.path):
            writer.write(np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA)))


def _in_stereo(sound: Stream, channels: int) -> Stream:
    """Audio with channels of an unknown layout, mixed to both sides."""
    if channels in LAYOUTS:
        return sound
    mean = "+".join(f"{1 / channels:.6f}*c{k}" for k in range(channels))
    return sound.filter("pan", args=f"stereo|c0={mean}|c1={mean}")


def _tags(metadata: Mapping[str, str]) -> dict[str, str]:
    """Options of ffmpeg that write tags of the container."""
    return {f"metadata:g:{k}": f"{key}={text}" for k, (key, text) in enumerate(metadata.items())}


def concat_list(parts: Sequence[tuple[Path, Fraction]]) -> str:
    """ffmpeg's list of files to join. Rounding of lengths to microseconds does not accumulate."""
    lines = ["ffconcat version 1.0"]
    ends = [Fraction(0), *accumulate(length for _, length in parts)]
    for (path, _), (start, end) in zip(parts, pairwise(ends), strict=True):
        if set(address(path)) & {"\n", "\r"}:
            raise MediaError("a line break in its path", str(path), "name the folder without")
        quoted = address(path).replace("'", r"'\''")
        micro = round(end * 10**6) - round(start * 10**6)
        lines += [f"file '{quoted}'", f"duration {micro // 10**6}.{micro % 10**6:06d}"]
    return "\n".join(lines) + "\n"
