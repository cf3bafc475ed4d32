"""What a media file holds: size after rotation, exact rate, frames, sound. PyAV reads it.

Every packet is visited (not decoded), so counts are those of the file, not of its header.
"""

from __future__ import annotations

import itertools
import stat
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

import av
import numpy as np

from dubbing.errors import MediaError
from dubbing.media.colour import Colour, colour_of
from dubbing.media.opening import opened
from dubbing.script.timecode import frame_of

COMMON_RATES = (
    *(Fraction(n) for n in (10, 12, 15, 20, 24, 25, 30, 48, 50, 60, 90, 100, 120)),
    *(Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 120)),
)
JITTER = 0.3  # largest departure of a time stamp from a constant rate, in frames
COMPLETE = 0.98  # of the frames the header promises (most containers promise none)
SHORTEST, LONGEST, SLIMMEST = 16, 16384, 10  # px, px, and one side over the other
FLOATS = {"pcm_f32le": "<f4", "pcm_f32be": ">f4", "pcm_f64le": "<f8", "pcm_f64be": ">f8"}
LOUDEST = 1e6  # 1 is full scale; the AAC encoder gives up from about 1e10
RESTARTS = 0x0200  # AVFMT_TS_DISCONT, a flag of containers; see `MediaInfo.zero`
ATTACHED_PICTURE = av.stream.Disposition.attached_pic


@dataclass(frozen=True)
class Picture:
    """Size as shown, colours, and what a picture of ours would not be.

    Attributes:
        interlaced: two fields a frame. square: its pixels are. bits: of each colour.
    """

    width: int
    height: int
    colour: Colour
    interlaced: bool = False
    square: bool = True
    bits: int = 8


@dataclass(frozen=True)
class MediaInfo:
    """A media file. Without a picture, width and frames are 0 and rate is None.

    Attributes:
        width, height: pixels as shown, after rotation and with square pixels.
        rate: frames a second. A clip of variable rate gets a constant one.
        frames: how many frames ``read_frames`` gives at that rate.
        duration: of the picture in seconds; of the sound, where there is no picture.
        video_start, audio_start: seconds after the start of the file; 0 for most files.
        zero: time stamp of the start of the file in seconds, where ffmpeg would count from the
            first stream it was asked for instead (MPEG-TS, MPEG-PS, Ogg); else None.
        timecode: of the first frame, as ``01:00:00:00``; '' where the file has none.
        picture: what the first frame shows; None without a picture.
    """

    path: Path
    width: int
    height: int
    rate: Fraction | None
    frames: int
    duration: float
    variable_rate: bool
    video_start: float
    picture: Picture | None
    audio_rate: int | None
    audio_channels: int | None
    audio_duration: float | None
    audio_start: float
    zero: float | None = None
    timecode: str = ""

    @property
    def colour(self) -> Colour:
        """Of its picture."""
        return self.picture.colour if self.picture else Colour()

    @property
    def first_frame(self) -> int:
        """The frame that its timecode begins with; 0 without one."""
        return frame_of(self.timecode, self.rate) if self.timecode and self.rate else 0

    @property
    def sound_seconds(self) -> float:
        """From the start of the file to the end of its sound; 0 without sound."""
        return self.audio_start + self.audio_duration if self.audio_duration else 0.0


def probe(path: Path | str) -> MediaInfo:
    """Read what ``path`` holds.

    Raises:
        MediaError: missing, unreadable, a playlist, neither picture nor sound in it, a picture of
            a shape that nobody films, pictures without time stamps, or sound that is no number.
    """
    path = Path(path)
    try:
        status = path.stat()
    except (OSError, ValueError):
        raise MediaError("no such file", str(path)) from None
    if not stat.S_ISREG(status.st_mode):
        raise MediaError("no such file", str(path))
    return _probe(path, status.st_size, status.st_mtime_ns, status.st_ino)


@lru_cache(maxsize=1024)  # the cues of a film look into it again and again
def _probe(path: Path, _size: int, _changed: int, _inode: int) -> MediaInfo:
    try:
        with opened(path) as container:
            return _read(path, container)
    except (av.FFmpegError, ValueError) as error:
        raise MediaError("not a readable media file", str(path), str(error)) from error


def count_frames(path: Path | str) -> int:
    """Count the pictures of ``path`` by decoding every one.

    Raises:
        MediaError: it cannot be decoded.
    """
    try:
        with opened(path) as container:
            container.streams.video[0].thread_type = "AUTO"
            return sum(1 for _ in container.decode(video=0))
    except (av.FFmpegError, IndexError) as error:
        raise MediaError("cannot be decoded", str(path), str(error)) from error


def _read(path: Path, container: av.container.InputContainer) -> MediaInfo:
    video = next((s for s in container.streams.video if not s.disposition & ATTACHED_PICTURE), None)
    sound = next(iter(container.streams.audio), None)
    if video is None and sound is None:
        raise MediaError("neither picture nor sound in it", str(path))
    times: list[float] = []
    pictures = untimed = 0
    floats = None if sound is None else FLOATS.get(_codec(path, sound))
    ends = {"video": 0.0, "audio": 0.0}
    starts: dict[str, float] = {}
    for packet in container.demux([s for s in (video, sound) if s is not None]):
        if packet.stream.type == "video" and packet.size > 0:
            pictures += 1
            untimed += packet.pts is None and packet.dts is None
        elif floats is not None and packet.size > 0:
            _check_sound(path, packet, floats)
        if packet.pts is None or packet.is_discard or packet.time_base is None:
            continue
        at = float(packet.pts * packet.time_base)
        length = float((packet.duration or 0) * packet.time_base)
        kind = packet.stream.type
        starts[kind] = min(starts.get(kind, at), at)
        ends[kind] = max(ends[kind], at + length)
        if kind == "video":
            times.append(at)
    zero = (container.start_time or 0) / av.time_base
    if video is not None and not times:
        raise MediaError("no frame in its video stream", str(path), "is the file complete?")
    there = _counted(container, pictures, times)
    if video is not None and there < COMPLETE * video.frames:
        broken = f"it breaks off: {there} of {video.frames} frames are there"
        raise MediaError(broken, str(path), "copy or convert the file again")
    if times and untimed:
        # Negative times of a Matroska file, for one: ffmpeg would guess, and drop what clashes.
        what = f"{untimed} of its {pictures} frames have no time stamp"
        raise MediaError(what, str(path), "convert the file again")
    if sound is not None and "audio" not in starts:
        sound = None  # a declared but empty track is no sound

    timecode = ""
    width = height = frames = 0
    rate: Fraction | None = None
    variable = False
    duration = 0.0
    picture: Picture | None = None
    video_start = starts.get("video", zero) - zero
    if video is not None:
        picture = _picture(path, video)
        width, height = picture.width, picture.height
        times.sort()
        if len(times) > 1 and times[0] == times[-1]:
            same = "all its frames have the same time stamp"
            raise MediaError(same, str(path), "convert the file again")
        hints = [r for r in (video.average_rate, video.guessed_rate) if r]
        rate, variable = choose_rate(times, hints)
        span = ends["video"] - times[0] if variable else float(len(times) / rate)
        frames = max(1, round((video_start + span) * rate))
        duration = float(frames / rate)
        timecode = _timecode(container, rate)
    # What lies before 0 is the priming of the encoder, which no decoder gives out.
    audio_start = max(0.0, starts.get("audio", zero) - zero)
    audio_duration = ends["audio"] - zero - audio_start if sound is not None else None
    return MediaInfo(
        path=path,
        width=width,
        height=height,
        rate=rate,
        frames=frames,
        duration=duration or float(audio_duration or 0),
        variable_rate=variable,
        video_start=video_start,
        picture=picture,
        audio_rate=sound.rate if sound is not None else None,
        audio_channels=sound.channels if sound is not None else None,
        audio_duration=audio_duration,
        audio_start=audio_start,
        zero=zero if container.format.flags & RESTARTS else None,
        timecode=timecode,
    )


def _counted(container: av.container.InputContainer, pictures: int, times: list[float]) -> int:
    """How many of the frames that a header counts are there: ``pictures``, with these times.

    That of an AVI counts ticks of its clock, which may be finer; its first and last frame may be a
    frame's length off.
    """
    many = len(times)
    if container.format.name != "avi" or many < 2:
        return pictures
    ticks = (max(times) - min(times)) / float(container.streams.video[0].time_base or 1)
    return max(pictures, round(ticks * (many + 1) / (many - 1)))


def _timecode(container: av.container.InputContainer, rate: Fraction) -> str:
    """The timecode of a track or of the file, if it is one at that rate."""
    places = [stream.metadata for stream in container.streams] + [container.metadata]
    tags = [item for place in places for item in place.items()]
    written = next((value for key, value in tags if key.lower() == "timecode"), "")
    try:
        frame_of(written, rate)
    except ValueError:
        return ""
    return written


def _codec(path: Path, sound: av.audio.stream.AudioStream) -> str:
    if sound.codec_context is None:  # PyAV's stubs do not say so
        what = "its sound is in a format that cannot be decoded"
        raise MediaError(what, str(path), "convert it to WAV of 16 or 24 bits")
    if not sound.channels or not sound.rate:
        raise MediaError("its sound has no channels, or no rate", str(path), "export it again")
    return sound.codec_context.name


def _check_sound(path: Path, packet: av.Packet, kind: str) -> None:
    size = np.dtype(kind).itemsize
    samples = np.frombuffer(memoryview(packet), kind, packet.size // size)
    with np.errstate(invalid="ignore"):
        good = samples.size == 0 or (samples.max() < LOUDEST and samples.min() > -LOUDEST)
    if not good:
        at = float((packet.pts or 0) * (packet.time_base or 0))
        what = f"its sound holds samples that are not finite numbers, from about {at:.1f} s on"
        raise MediaError(what, str(path), "export it again, with 16 or 24 bits")


def choose_rate(times: Sequence[float], hints: Sequence[Fraction]) -> tuple[Fraction, bool]:
    """The constant frame rate that sorted time stamps (seconds) follow, and whether they vary.

    The last of several is later than the first.

    Constant: the first of the snapped hints, the hints and the snapped mean that puts every
    stamp within ``JITTER`` frames of its place. Variable: the common rate nearest to the
    usual interval, so that a clip with dropped frames keeps the rate it was filmed at.
    """
    if len(times) < 2:
        return (hints[0] if hints else Fraction(25)), False
    pace = (len(times) - 1) / (times[-1] - times[0])
    mean = Fraction(pace).limit_denominator(1001)
    candidates = [_snap(hint) for hint in hints] + list(hints) + [_snap(mean), mean]
    for rate in candidates:
        if all(abs((t - times[0]) * rate - k) < JITTER for k, t in enumerate(times)):
            return rate, False
    intervals = [b - a for a, b in itertools.pairwise(times)]
    median = statistics.median(intervals)
    # Their mean, because time stamps in whole milliseconds make 33 and 34 of 1/30 s.
    regular = [interval for interval in intervals if abs(interval - median) < 0.5 * median]
    typical = 1 / statistics.fmean(regular) if median > 0 else pace
    return min(COMMON_RATES, key=lambda r: max(r / typical, typical / r)), True


def _snap(rate: Fraction) -> Fraction:
    nearest = min(COMMON_RATES, key=lambda common: abs(common - rate))
    return nearest if abs(nearest - rate) < Fraction(3, 10000) * rate else rate


def _picture(path: Path, video: av.video.stream.VideoStream) -> Picture:
    """What the first decoded frame shows."""
    with opened(path) as container:
        frame = next(container.decode(container.streams[video.index]), None)
    if not isinstance(frame, av.VideoFrame):
        raise MediaError("no frame of it can be decoded", str(path), "is the file complete?")
    width, height = frame.width, frame.height
    aspect = video.sample_aspect_ratio
    if aspect:
        width = round(width * aspect)
    if frame.rotation % 180:
        width, height = height, width
    sides = sorted((width, height))
    stored = min(frame.width, frame.height)
    if min(stored, sides[0]) < SHORTEST or sides[1] > min(LONGEST, SLIMMEST * sides[0]):
        what = f"its picture is {width}x{height} px as shown"
        if (frame.width, frame.height) not in ((width, height), (height, width)):
            what += f", {frame.width}x{frame.height} px as stored"
        bounds = f"{SHORTEST} to {LONGEST} px a side, one at most {SLIMMEST} times the other"
        raise MediaError(what, str(path), f"use a video of {bounds}")
    deep = max((part.bits for part in frame.format.components), default=8)
    return Picture(
        width,
        height,
        colour_of(frame),
        interlaced=bool(frame.interlaced_frame),
        square=not aspect or aspect == 1,
        bits=deep,
    )
