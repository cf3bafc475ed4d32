"""Reads frames and audio of a file; memory does not grow with the length."""

import math
import tempfile
from collections.abc import Iterator
from fractions import Fraction
from itertools import takewhile
from pathlib import Path

import numpy as np

from dubbing.engine.disk.numbered import numbered
from dubbing.errors import MediaError
from dubbing.media.opening.ffmpeg import Process
from dubbing.media.opening.opening import Graph, address, in_time, into, picture_of, sound_of
from dubbing.media.probing.probing import probe
from dubbing.media.properties.info import MediaInfo
from dubbing.media.properties.native import PixelFormat, Planes
from dubbing.media.reading.voice_channel import voice_channel
from dubbing.media.sequences import sequence

CHANNELS = {"rgb24": (3,), "rgba": (4,), "gray": ()}
DEEP = "rgb48"  # of films that are shown in another colour space than their own
SEEK_LEADS = (20, 320, 5120)  # frames; the first is more than any codec reorders
NEAREST = 0.5  # frames, largest distance of a picture from the time at which it is used
MISSING = 0.5  # seconds of audio that a decoder may lose, as at a damaged end
# Exact rounding, and chroma at full resolution: the default shifts colours by a level or two.
SCALER = "bicubic+accurate_rnd+full_chroma_int+full_chroma_inp"


def read_frames(
    path: Path | str,
    *,
    start: int = 0,
    count: int | None = None,
    rate: Fraction | None = None,
    pixels: str = "rgb24",
) -> Iterator[np.ndarray]:
    """Frames ``start`` .. ``start + count`` at a constant rate; to the end by default.

    Frame k is the picture displayed at time k / rate (nearest, so time stamps may jitter by half a
    frame). A late start gives the same frames as reading from the beginning: where a seek lands
    after its frame, by the time stamps, an earlier one is tried.

    Args:
        path: a video.
        start: first frame, counted at ``rate``.
        count: number of frames; fewer at the end of the video.
        rate: frames a second; the video's own by default.
        pixels: ``rgb24`` (H, W, 3), what a display shows; ``rgba`` (H, W, 4) or ``gray`` (H, W);
            uint8.

    Raises:
        MediaError: no picture, or the file ends before its last frame.
    """
    info = probe(path)
    if numbered(info.path) and pixels == "rgb24":
        yield from sequence.read_frames(info.path, start, count, rate or info.rate)
        return
    shape = (info.height, info.width, *CHANNELS[pixels])
    if not info.values.film or pixels != "rgb24":
        for frame in _frames(info, start, count, rate, pixels, math.prod(shape)):
            yield frame.reshape(shape)
        return
    for frame in _frames(info, start, count, rate, DEEP, 2 * math.prod(shape)):
        yield info.values.picture(frame.view(np.uint16).reshape(shape))


def read_planes(
    path: Path | str,
    *,
    start: int = 0,
    count: int | None = None,
    rate: Fraction | None = None,
    pixels: PixelFormat | None = None,
) -> Iterator[Planes]:
    """The same frames as planes: of the video's own values, or as `pixels`; see `read_frames`."""
    info = probe(path)
    if numbered(info.path):
        for image in read_frames(path, start=start, count=count, rate=rate):
            yield [image[..., k] for k in (1, 2, 0)]
        return
    pixels, size = pixels or info.pixels, (info.width, info.height)
    for frame in _frames(info, start, count, rate, pixels.name, pixels.size(*size)):
        yield pixels.planes(frame, *size)


def _frames(
    info: MediaInfo, start: int, count: int | None, rate: Fraction | None, pixels: str, size: int
) -> Iterator[np.ndarray]:
    """Frames as `size` bytes each, (size,) uint8."""
    path = info.path
    if start < 0:
        raise MediaError(f"frame {start} is before its beginning", str(path), "begin at 0 or later")
    rate = rate or info.rate
    total = info.frames if rate == info.rate else round(info.duration * rate)
    count = max(0, total - start if count is None else min(count, total - start))
    if count == 0:
        return
    # Without an index (MPEG-TS, MPEG-PS) a seek may land between key frames, and decoding begins
    # at the next one, too late. The last lead goes back to the start, without a seek.
    for lead in (*takewhile(lambda frames: frames < start, SEEK_LEADS), start):
        with tempfile.TemporaryDirectory() as folder:  # Windows opens no open file once more
            note = Path(folder, "note.txt")
            graph = _frame_graph(info, str(note), start, lead, count, rate, pixels)
            with Process(graph, str(path), pipe_out=True) as process:
                for index in range(count):
                    frame = np.empty(size, np.uint8)
                    filled = process.fill(frame.data)
                    if index == 0 and lead < start and not _landed(_content(note), lead, rate):
                        break
                    if not filled:
                        process.finish()
                        raise MediaError(
                            f"broke off at frame {start + index} of {total}",
                            str(path),
                            "the file is damaged; copy or convert it again",
                        )
                    yield frame
                else:
                    return


def read_audio(
    path: Path | str, *, rate: int = 16000, start: float = 0.0, seconds: float | None = None
) -> np.ndarray:
    """Mono float32 (samples,), resampled to ``rate`` Hz: the mean of the channels.

    Of those that have the voice, where they would cancel it; see `voice_channel`.

    Raises:
        MediaError: no sound, or it cannot be decoded.
    """
    blocks = list(iter_audio(path, rate=rate, start=start, seconds=seconds))
    return np.concatenate(blocks) if blocks else np.zeros(0, np.float32)


def iter_audio(
    path: Path | str,
    *,
    rate: int = 16000,
    start: float = 0.0,
    seconds: float | None = None,
    block_seconds: float = 10.0,
) -> Iterator[np.ndarray]:
    """The same as ``read_audio`` in blocks of ``block_seconds``, the last one shorter."""
    info = probe(path)
    if info.audio_rate is None or info.audio_channels is None:
        raise MediaError("no sound in it", str(path))
    sound = sound_of(path, info.zero, start, info.audio_tracks)
    weights = voice_channel(info, start, seconds).weights
    mean = "+".join(f"{weight:.8f}*c{k}" for k, weight in enumerate(weights) if weight)
    sound = sound.filter("pan", args=f"mono|c0={mean}").filter("aresample", rate)
    if seconds is not None:
        sound = sound.filter("atrim", end_sample=round(seconds * rate))
    graph = into(None, sound, format="f32le", ar=rate)
    expected = info.audio_start + (info.audio_duration or 0) - start
    expected = expected if seconds is None else min(expected, seconds)
    yield from _samples(graph, path, max(1, round(block_seconds * rate)), expected * rate, rate)


def iter_channels(
    path: Path | str, *, rate: int, channels: int, block_seconds: float = 10.0
) -> Iterator[np.ndarray]:
    """All channels of a file's audio as float32 blocks (samples, C), mixed to C channels.

    Raises:
        MediaError: no sound, or it cannot be decoded.
    """
    info = probe(path)
    if info.audio_rate is None:
        raise MediaError("no sound in it", str(path))
    if channels == 1:
        for mono in iter_audio(path, rate=rate, block_seconds=block_seconds):
            yield mono[:, None]
        return
    sound = sound_of(path, info.zero, 0.0, info.audio_tracks).filter("aresample", rate)
    # With `ac`, ffmpeg would reorder the channels even where their number is right.
    mixed = {} if channels == info.audio_channels else {"ac": channels}
    graph = into(None, sound, format="f32le", ar=rate, **mixed)
    expected = channels * rate * (info.audio_start + (info.audio_duration or 0))
    count = channels * max(1, round(block_seconds * rate))
    for block in _samples(graph, path, count, expected, channels * rate):
        yield block[: len(block) // channels * channels].reshape(-1, channels)


def _samples(
    graph: Graph, path: Path | str, count: int, expected: float, rate: int
) -> Iterator[np.ndarray]:
    """Decoded samples, float32, ``count`` at a time.

    Args:
        expected: number of samples by the packets of the file. rate: samples a second.

    Raises:
        MediaError: it cannot be decoded, or not to its end.
    """
    decoded = 0
    with Process(graph, str(path), pipe_out=True) as process:
        while block := process.stdout.read(4 * count):
            samples = np.frombuffer(block[: len(block) // 4 * 4], np.float32)
            decoded += len(samples)
            yield samples
        process.finish()
    if decoded < expected - MISSING * rate:
        what = f"only {decoded / rate:.1f} s of {expected / rate:.1f} s of its sound can be decoded"
        raise MediaError(what, str(path), "convert the file again")


def _frame_graph(
    info: MediaInfo, note: str, start: int, lead: int, count: int, rate: Fraction, pixels: str
) -> Graph:
    # Seek to the key frame before the wanted time, without the exact trim: the picture displayed
    # then may have started before it, and fps with start_time=0 drops earlier ones. A seek in a
    # file whose decoding times are ahead of its display times lands late by a few frames: hence the
    # lead. The time of the first key frame goes to the note; frames before it may be broken.
    begin = float((start - lead) / rate)
    seek = {"ss": f"{begin:.6f}", "noaccurate_seek": None} if start > lead else {}
    picture = in_time(picture_of(info.path, info.zero, begin, **seek), info.late)
    if start > lead:
        picture = picture.filter("select", "if(isnan(prev_selected_n),key,1)")
        picture = picture.filter("metadata", mode="add", key="first", value=1)
        options = {"file": address(note), "direct": 1, "enable": "eq(n,0)"}
        picture = picture.filter("metadata", mode="print", **options)
    picture = picture.filter("fps", fps=f"{rate}", start_time=0, round="near")
    if lead:
        picture = picture.filter("trim", start_frame=lead).filter("setpts", "PTS-STARTPTS")
    # The last picture is displayed to the end of the video.
    picture = picture.filter("tpad", stop_mode="clone", stop=2)
    size = {"w": info.width, "h": info.height, "flags": SCALER}
    if pixels in ("rgb24", DEEP):
        picture = picture.filter("scale", **size, in_color_matrix=info.colour.matrix)
    elif pixels == info.pixels.name and not info.pixels.rgb and info.pixels.count > 1:
        levels = "pc" if info.colour.full_range else "tv"
        picture = picture.filter("scale", **size, out_range=levels)
    else:
        picture = picture.filter("scale", **size)
    return into(None, picture, format="rawvideo", pix_fmt=pixels, vframes=count)


def _content(note: Path) -> str:
    return note.read_text() if note.exists() else ""


def _landed(note: str, lead: int, rate: Fraction) -> bool:
    """Whether there is a key frame, at the time in the note, and frame ``lead`` not before it."""
    _, options, time = note.partition("pts_time:")
    return bool(options) and float(time.split()[0]) * rate < lead + NEAREST
