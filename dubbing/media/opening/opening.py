"""Opens files for ffmpeg and PyAV; nothing else passes a path to them.

Both open more than files: a name may be an address (``http:``, ``tcp:``, ``concat:``), and a text
may list other files to open. Here every path is made absolute and marked as a file, no other
protocol is allowed, and only containers that hold their own picture and sound are opened.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import av
import ffmpeg

from dubbing.engine.disk.numbered import plain
from dubbing.errors import MediaError

PROTOCOLS = "file,pipe"
# Without those that open other files or draw text: concat, hls, dash, imf, image2, sdp, tty, ...
CONTAINERS = (
    *("mov", "matroska", "avi", "mpegts", "mpeg", "mxf", "gxf", "flv", "asf", "nut", "ogg", "rm"),
    *("dv", "wtv", "ty", "nsv", "ivf", "obu", "av1", "apv", "evc", "vvc", "hevc", "h264", "h263"),
    *("h261", "m4v", "mpegvideo", "mjpeg", "vc1", "cavsvideo", "dirac", "dnxhd", "r3d", "cine"),
    *("yuv4mpegpipe", "gif", "apng", "wav", "w64", "aiff", "au", "caf", "flac", "mp3", "aac"),
    *("loas", "ac3", "eac3", "dts", "dtshd", "truehd", "mlp", "ape", "wv", "tta", "tak", "shn"),
    *("mpc", "mpc8", "amr", "amrnb", "amrwb", "gsm", "oma", "aa", "aax", "voc", "dsf", "iff"),
    *("sox", "ircam", "nistsphere", "pvf", "avr", "xwma", "sbc"),
)
REFUSED = "a playlist, a still picture, or no film or sound that can be read"
REMEDY = "convert it to one file of its own: .mp4, .mov, .mkv or .wav"
PLAYLISTS = (b"#extm3u", b"ffconcat", b"[playlist]")  # first bytes, whatever the file's name
SEEK_LEAD = 1.5  # seconds; more than a picture is late, and than a decoder needs to begin
GAPS = {"async": 1, "first_pts": 0, "min_hard_comp": 0.02}  # s; longer ones between packets stay
WAV_PACKET = 1 << 18  # bytes; with the default ones a long recording takes twice the time

# Layouts by the number of channels, as in films.
LAYOUTS = {1: "mono", 2: "stereo", 3: "3.0", 4: "quad", 5: "5.0", 6: "5.1", 7: "6.1", 8: "7.1"}

Stream = Any  # ffmpeg-python's nodes have no types
Graph = Any


def address(path: Path | str) -> str:
    """The address of ``path`` for ffmpeg and PyAV: a file, whatever its name looks like.

    Raises:
        MediaError: the path is not valid UTF-8.
    """
    if (text := os.fsencode(path).decode(errors="replace")) != str(path):
        raise MediaError("its name or folder is not valid UTF-8", text, "rename it")
    return f"file:{os.path.abspath(plain(Path(path)))}"


def opened(path: Path | str, *, short_packets: bool = False) -> av.container.InputContainer:
    """``path`` open for reading by PyAV; a context manager.

    Args:
        short_packets: of a WAV, to read a few places: it opens in a tenth of the time.

    Raises:
        MediaError: it is a playlist, or another kind of file without its own picture or sound.
        av.FFmpegError: it cannot be read.
    """
    if _begins_as_playlist(path):
        raise MediaError("a playlist: it names other files, and holds nothing", str(path), REMEDY)
    options = _only(CONTAINERS)
    if not short_packets:
        options["max_size"] = str(WAV_PACKET)
    try:
        return av.open(address(path), container_options=options)
    except av.ArgumentError as error:
        raise MediaError(REFUSED, str(path), REMEDY) from error


def source(path: Path | str, **options: Any) -> Stream:
    """``path`` as an input of an ffmpeg-python graph.

    Filters are not begun anew where size, colours or channels change, as in a call over a network:
    they would lose frames, and pad sound with silence once more.
    """
    return ffmpeg.input(address(path), **_only(CONTAINERS), reinit_filter=0, **options)


def picture_of(path: Path | str, zero: float, begin: float, **options: Any) -> Stream:
    """The picture of ``path``, its times counted from ``begin`` seconds after ``zero``.

    ``zero``: see `MediaInfo.zero`; options seek to ``begin``, where it is not 0.
    """
    picture = source(path, copyts=None, **options)["V:0"]  # V: but for pictures of a cover
    return picture.filter("setpts", _since(zero, begin))


def in_time(picture: Stream, late: float) -> Stream:
    """A decoded picture with its times of display, that are given late by so many seconds."""
    return picture.filter("setpts", f"round(PTS-{late:.6f}/TB)") if late else picture


def sound_of(path: Path | str, zero: float, begin: float, tracks: Sequence[int] = (0,)) -> Stream:
    """The sound of ``path`` from ``begin`` seconds after ``zero`` on; see `picture_of`.

    Sound that starts late in its file is padded with silence before it. Several tracks, of a
    channel each, become the channels of one sound. A seek is only good to a packet or two, and
    where the first key frame of the picture is later it ends anywhere: it goes to some time before.

    Raises:
        MediaError: ``begin`` is before the file.
    """
    if begin < 0:
        what = f"sound from {begin:g} s on, before its beginning"
        raise MediaError(what, str(path), "begin at 0 or later")
    early = begin - SEEK_LEAD
    seek = {"ss": f"{early:.6f}", "noaccurate_seek": None} if early > SEEK_LEAD else {}
    film = source(path, copyts=None, **seek)
    sounds = []
    for track in tracks:
        sound = film[f"a:{track}"].filter("asetpts", _since(zero, begin))
        sounds.append(sound.filter("aresample", **GAPS))
    if len(sounds) == 1:
        return sounds[0]
    layout = LAYOUTS[len(sounds)]
    placed = [s.filter("pan", args=f"{layout}|c{k}=c0") for k, s in enumerate(sounds)]
    # Unlike other filters it continues to the end of the longest.
    return ffmpeg.filter(placed, "amix", inputs=len(placed), duration="longest", normalize=0)


def joined(listing: Path | str) -> Stream:
    """The files of a list, concatenated, as an input. The list must be written by us."""
    options = _only(("concat", *CONTAINERS))
    return ffmpeg.input(address(listing), format="concat", safe=0, **options)


def piped(**options: Any) -> Stream:
    """Raw frames from a pipe as an input."""
    return ffmpeg.input("pipe:", format="rawvideo", **options)


def into(path: Path | str | None, *streams: Stream, **options: Any) -> Graph:
    """The graph that writes streams to ``path``, or to a pipe where it is None."""
    return ffmpeg.output(*streams, "pipe:" if path is None else address(path), **options)


def _begins_as_playlist(path: Path | str) -> bool:
    """Whether a file is a playlist; ffmpeg would read one that is named like raw audio."""
    try:
        with open(plain(Path(path)), "rb") as file:
            begin = file.read(64)
    except (OSError, ValueError):
        return False  # opening it reports the error
    return begin.removeprefix(b"\xef\xbb\xbf").lstrip().lower().startswith(PLAYLISTS)


def _since(zero: float, begin: float) -> str:
    return f"round(PTS-({zero:.6f}+{begin:.6f})/TB)"


def _only(containers: tuple[str, ...]) -> dict[str, str]:
    return {"protocol_whitelist": PROTOCOLS, "format_whitelist": ",".join(containers)}
