"""Video and audio files. The only package that runs ffmpeg.

Images are RGB uint8 arrays (H, W, 3), or planes of the film's own values; audio is mono float32
(samples,) in -1..1; times are seconds from the start of the file, and frame rates exact fractions.
"""

from dubbing.media.opening.ffmpeg import binary, version
from dubbing.media.probing.coded import coded_pictures, count_frames
from dubbing.media.probing.probing import probe
from dubbing.media.properties.info import MediaInfo
from dubbing.media.properties.native import PixelFormat, Planes
from dubbing.media.reading.reading import (
    iter_audio,
    iter_channels,
    read_audio,
    read_frames,
    read_planes,
)
from dubbing.media.reading.sound_blocks import sound_blocks
from dubbing.media.writing.muxing import SOUND, cut, mux, proxy
from dubbing.media.writing.writing import CODECS, SUFFIX, VideoWriter

__all__ = [
    "CODECS",
    "SOUND",
    "SUFFIX",
    "MediaInfo",
    "PixelFormat",
    "Planes",
    "VideoWriter",
    "binary",
    "coded_pictures",
    "count_frames",
    "cut",
    "iter_audio",
    "iter_channels",
    "mux",
    "probe",
    "proxy",
    "read_audio",
    "read_frames",
    "read_planes",
    "sound_blocks",
    "version",
]
