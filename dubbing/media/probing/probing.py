"""Reads the properties of a media file, with PyAV.

Every packet is read (not decoded), so counts are those of the file, not of its header.
"""

import os
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import inf
from pathlib import Path

import av
import numpy as np

from dubbing.engine.disk.numbered import numbered, options_of, plain
from dubbing.engine.disk.unchanged import while_unchanged
from dubbing.errors import MediaError
from dubbing.media.opening.opening import opened
from dubbing.media.opening.tracks import Track, heard_tracks, pictures
from dubbing.media.probing.picture import AVI, picture_of
from dubbing.media.probing.timecode_track import timecode_of
from dubbing.media.probing.whole import check_frames, check_order, check_whole
from dubbing.media.properties.film_values import FilmValues
from dubbing.media.properties.frame_rate import choose_rate
from dubbing.media.properties.info import MediaInfo, Picture
from dubbing.media.sequences import sequence

FLOATS = {"pcm_f32le": "<f4", "pcm_f32be": ">f4", "pcm_f64le": "<f8", "pcm_f64be": ">f8"}
LOUDEST = 1e6  # 1 is full scale; the AAC encoder fails from about 1e10


def probe(path: Path | str) -> MediaInfo:
    """Read the properties of the media file ``path``.

    Raises:
        MediaError: missing, unreadable, a playlist, without picture and sound, a picture of an
            unusual shape, frames without time stamps or with times that begin anew, or sound with
            NaN.
    """
    path = Path(path)
    if numbered(path):
        return sequence.probe(path)
    if not os.path.isfile(plain(path)):
        raise MediaError("no such file", str(path))
    return _probe(path)


@while_unchanged(1024, kept=MediaInfo)  # each cue of a film probes it again
def _probe(path: Path) -> MediaInfo:
    try:
        with opened(path) as container:
            info = _read(plain(path), container)
            return replace(
                info, path=path, values=FilmValues.of(options_of(path), info.colour.space)
            )
    except (av.FFmpegError, ValueError) as error:
        raise MediaError("not a readable media file", str(path), str(error)) from error


def _read(path: Path, container: av.container.InputContainer) -> MediaInfo:
    videos = pictures(container)
    video = next(iter(videos), None)
    tracks = list(container.streams.audio)
    heard = heard_tracks(tracks)
    if video is None and not heard:
        raise MediaError("neither picture nor sound in it", str(path))
    zero = (container.start_time or 0) / av.time_base
    packets = _visit(path, container, video, heard, zero)
    if "audio" not in packets.starts:
        heard = []  # a declared but empty track is no sound
    width = height = frames = 0
    rate: Fraction | None = None
    variable, duration, timecode, late = False, 0.0, "", 0.0
    count: int | None = None
    picture: Picture | None = None
    video_start = packets.starts.get("video", zero) - zero
    told = 0 if video is None else video.frames
    if video is not None and "mov" in container.format.name:
        told = min(told, len(video.index_entries))  # those that no edit list leaves out
    check_whole(path, container, told, packets.pictures, packets.times, packets.last - zero)
    if video is not None:
        check_frames(path, packets.pictures, packets.untimed, packets.times)
        picture, late = picture_of(path, video)
        width, height = picture.width, picture.height
        times = sorted(packets.times)
        hints = [r for r in (video.average_rate, video.guessed_rate) if r]
        rate, variable = choose_rate(times, hints)
        span = packets.ends["video"] - times[0] if variable else float(len(times) / rate)
        frames = max(1, round((video_start + span) * rate))
        duration = float(frames / rate)
        timecode, count = timecode_of(path, container, rate)
    # Audio before 0 is the priming of the encoder, which no decoder returns.
    audio_start = max(0.0, packets.starts.get("audio", zero) - zero)
    audio_duration = packets.ends["audio"] - zero - audio_start if heard else None
    return MediaInfo(
        path=path,
        width=width,
        height=height,
        frame_rate=rate,
        frames=frames,
        duration=duration or float(audio_duration or 0),
        variable_rate=variable,
        video_start=video_start,
        picture=picture,
        audio_rate=heard[0].rate if heard else None,
        audio_channels=sum(track.channels for track in heard) if heard else None,
        audio_duration=audio_duration,
        audio_start=audio_start,
        zero=zero,
        timecode=timecode,
        timecode_count=count,
        audio_tracks=tuple(tracks.index(track) for track in heard),
        unheard_tracks=len(tracks) - len(heard),
        unseen_tracks=max(0, len(videos) - 1),
        centre=_centre(heard),
        peak=packets.peak,
        late=late,
        primed=container.format.name in (AVI, "aac")
        and any(_codec(path, t) == "aac" for t in heard),
    )


def _centre(heard: list[Track]) -> int | None:
    """Index of the channel that the only track read says is the centre of several."""
    names = [channel.name for channel in heard[0].layout.channels] if len(heard) == 1 else []
    return names.index("FC") if len(names) > 1 and "FC" in names else None


@dataclass
class _Packets:
    """Counts and times of the packets of a file; times in seconds, by kind of stream.

    Attributes:
        last: end of the last packet of any stream.
        peak: of samples in floating point; see `MediaInfo.peak`.
        pictures, untimed: packets with a frame, and those of them without a time stamp.
        times: of the frames.
    """

    pictures: int = 0
    last: float = 0.0
    peak: float = 0.0
    untimed: int = 0
    times: list[float] = field(default_factory=list)
    starts: dict[str, float] = field(default_factory=dict)
    ends: dict[str, float] = field(default_factory=lambda: {"video": 0.0, "audio": 0.0})


def _visit(
    path: Path,
    container: av.container.InputContainer,
    video: av.video.stream.VideoStream | None,
    heard: list[Track],
    zero: float,
) -> _Packets:
    packets = _Packets()
    floats = {track.index: FLOATS.get(_codec(path, track)) for track in heard}
    wanted = {stream.index for stream in (video, *heard) if stream is not None}
    decoding = container.format.name == AVI
    decoded: dict[int, float] = {}
    for packet in container.demux():
        unit = packet.time_base or 0  # none, of a packet without time stamps
        stamp = packet.dts if decoding and packet.stream.type == "video" else packet.pts
        at = float((stamp or 0) * unit)
        end = at + float((packet.duration or 0) * unit)
        packets.last = max(packets.last, end)  # of any stream
        if packet.stream.index not in wanted:
            continue
        kind = packet.stream.type
        if kind == "video" and packet.size > 0:
            packets.pictures += 1
            packets.untimed += packet.pts is None and packet.dts is None
        elif (kept := floats.get(packet.stream.index)) is not None and packet.size > 0:
            packets.peak = max(packets.peak, _peak(path, packet, kept))
        if packet.dts is not None and not packet.is_discard:
            before = decoded.get(packet.stream.index, -inf)
            decoded[packet.stream.index] = float(packet.dts * unit) - zero
            check_order(path, before, decoded[packet.stream.index])
        if packet.pts is None or packet.is_discard or not unit:
            continue
        packets.starts[kind] = min(packets.starts.get(kind, at), at)
        packets.ends[kind] = max(packets.ends[kind], end)
        if kind == "video":
            packets.times.append(at)
    return packets


def _codec(path: Path, sound: Track) -> str:
    if sound.codec_context is None:  # PyAV's stubs omit it
        what = "its sound is in a format that cannot be decoded"
        raise MediaError(what, str(path), "convert it to WAV of 16 or 24 bits")
    if not sound.channels or not sound.rate:
        raise MediaError("its sound has no channels, or no rate", str(path), "export it again")
    return sound.codec_context.name


def _peak(path: Path, packet: av.Packet, kind: str) -> float:
    size = np.dtype(kind).itemsize
    samples = np.frombuffer(memoryview(packet), kind, packet.size // size)
    with np.errstate(invalid="ignore"):
        peak = float(np.abs(samples).max(initial=0))
    if not peak < LOUDEST:
        at = float((packet.pts or 0) * (packet.time_base or 0))
        what = f"its sound holds samples that are not finite numbers, from about {at:.1f} s on"
        raise MediaError(what, str(path), "export it again, with 16 or 24 bits")
    return peak
