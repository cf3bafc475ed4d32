"""Writes frames to a video file, through an ffmpeg that encodes in parallel."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from dubbing.engine.disk.files import atomic_path
from dubbing.errors import MediaError
from dubbing.media.opening.ffmpeg import Process
from dubbing.media.opening.opening import Graph, into, piped
from dubbing.media.properties.colour import Colour
from dubbing.media.properties.native import RGB, PixelFormat, Planes
from dubbing.media.reading.reading import CHANNELS

# x264's result depends on its number of threads: a fixed one gives the same file everywhere.
THREADS = 4


@dataclass(frozen=True)
class Codec:
    """How frames are encoded.

    Attributes:
        encoder: options of ffmpeg.
        formats: of pixels in the file, the one for 8 bits and the one for more; empty: the film's.
        full_range: whether all levels may be used. even: whether 4:2:0 needs even sides.
    """

    encoder: dict[str, Any] = field(default_factory=dict)
    formats: tuple[str, str] | None = None
    full_range: bool = True
    even: bool = False

    def format_for(self, pixels: PixelFormat) -> str:
        """Format of pixels in the file."""
        if self.formats is not None:
            return self.formats[pixels.bits > 8]
        return "bgr0" if pixels.name == "gbrp" else pixels.name  # what FFV1 calls it


def _always(name: str) -> tuple[str, str]:
    return name, name


def _for_editing(name: str, encoder: dict[str, Any]) -> Codec:
    return Codec(encoder, _always(name), full_range=False, even=True)


LOSSLESS = {"vcodec": "ffv1", "level": 3, "slices": 4}
PRORES = {"vcodec": "prores_ks", "vendor": "apl0"}
CODECS = {
    "h264": Codec(
        {"vcodec": "libx264", "crf": 16, "preset": "veryfast"},
        _always("yuv420p"),  # browsers play no other
        even=True,
    ),
    "hevc": Codec(
        {"vcodec": "libx265", "crf": 12, "preset": "fast", "tag:v": "hvc1"},
        ("yuv420p", "yuv420p10le"),
        even=True,
    ),
    "prores": _for_editing("yuv422p10le", PRORES | {"profile:v": "hq"}),
    "prores4444": _for_editing("yuv444p10le", PRORES | {"profile:v": "4444"}),
    "dnxhr": _for_editing("yuv422p10le", {"vcodec": "dnxhd", "profile:v": "dnxhr_hqx"}),
    "ffv1": Codec(LOSSLESS),
    "ffv1-rgba": Codec(LOSSLESS, _always("bgra")),
    "ffv1-gray": Codec(LOSSLESS, _always("gray")),
}
RAW = {"ffv1-rgba": "rgba", "ffv1-gray": "gray"}  # pixels of frames that are no film's

SUFFIX = {  # of files for people
    **{"h264": ".mp4", "hevc": ".mp4", "ffv1": ".mkv"},
    **dict.fromkeys(("prores", "prores4444", "dnxhr"), ".mov"),
}


class VideoWriter:
    """Context manager: ``write`` frames; the complete file appears when the block ends well.

    ``codec``: ``h264`` (crf 16) and ``hevc`` (crf 12: within one value of 10 bits), both 4:2:0,
    ``prores`` (422 HQ), ``prores4444`` and ``dnxhr`` (HQX) for people; lossless ``ffv1``,
    ``ffv1-rgba`` and ``ffv1-gray``. An odd side of a 4:2:0 picture is made even by repeating its
    last line. ``colour``: colour space of the frames, BT.709 by default; ProRes and DNxHR always
    have video levels. ``pixels``: of a film whose planes are written; RGB pictures by default. The
    bytes of the file depend only on the frames and on ffmpeg.

    Raises:
        MediaError: a frame of another shape, or ffmpeg failed.
    """

    def __init__(
        self,
        path: Path | str,
        width: int,
        height: int,
        rate: Fraction,
        codec: str = "h264",
        colour: Colour | None = None,
        pixels: PixelFormat | None = None,
    ) -> None:
        self.path = Path(path)
        self.codec = CODECS[codec]
        self.frames = 0
        self._raw = RAW.get(codec, "rgb24") if pixels is None else pixels.name
        self._pixels = pixels or RGB
        self._kind = np.dtype(np.uint8) if pixels is None else pixels.kind

        def shapes(width: int, height: int) -> list[tuple[int, ...]]:
            if pixels is None:
                return [(height, width, *CHANNELS[self._raw])]
            return [*pixels.shapes(width, height)]

        extra = (width % 2, height % 2) if self.codec.even else (0, 0)
        self._size = width + extra[0], height + extra[1]
        self._shapes, even = shapes(width, height), shapes(*self._size)
        self._pad = [
            [(0, there - here) for here, there in zip(own, wanted, strict=True)]
            for own, wanted in zip(self._shapes, even, strict=True)
        ]
        self._rate = rate
        self._colour = colour
        self._stack = ExitStack()
        self._process: Process | None = None

    def __enter__(self) -> VideoWriter:
        temporary = self._stack.enter_context(atomic_path(self.path))
        graph = self._graph(temporary)
        self._process = self._stack.enter_context(Process(graph, str(self.path), pipe_in=True))
        self._stack.push(self._finish)
        return self

    def write(self, frame: np.ndarray | Planes) -> None:
        """Add one frame: planes of ``pixels``; or uint8, RGB, RGBA or grey as the codec needs."""
        assert self._process is not None, "write() outside of the with block"
        planes = frame if isinstance(frame, list) else [frame]
        if [p.shape for p in planes] != self._shapes or any(p.dtype != self._kind for p in planes):
            given = ", ".join(f"{p.dtype}{list(p.shape)}" for p in planes)
            wanted = ", ".join(f"{self._kind}{list(shape)}" for shape in self._shapes)
            raise MediaError(f"a frame is {given}, not {wanted}", str(self.path))
        try:
            for plane, pad in zip(planes, self._pad, strict=True):
                whole = np.pad(plane, pad, mode="edge") if np.any(pad) else plane
                self._process.stdin.write(np.ascontiguousarray(whole).data.cast("B"))
        except BrokenPipeError:
            self._process.finish()
            raise
        self.frames += 1

    def __exit__(self, *raised: Any) -> None:
        self._stack.__exit__(*raised)

    def _finish(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None and self._process is not None:
            if self.frames == 0:
                raise MediaError("no frames were written", str(self.path))
            self._process.finish()

    def _graph(self, path: Path) -> Graph:
        width, height = self._size
        # `r` too: otherwise ffmpeg guesses from the times, 120 for 120000/1001.
        rates = {"framerate": f"{self._rate}", "r": f"{self._rate}"}
        there, film = self.codec.format_for(self._pixels), self._colour or Colour()
        picture = piped(pix_fmt=self._raw, s=f"{width}x{height}", **rates, **film.static())
        colour = film if self.codec.full_range else replace(film, full_range=False)
        yuv = there.startswith(("yuv", "gray")) and self._raw not in RAW.values()
        tags = colour.tags() if yuv or self._colour else {}
        if self._pixels.rgb is False:  # planes bring no tags with them
            picture = picture.filter("setparams", **film.tags())
        if yuv and (there != self._raw or colour.full_range != film.full_range):
            picture = picture.filter(
                "scale",
                out_color_matrix=colour.matrix,
                out_range=tags["range"],
                flags="bicubic+accurate_rnd+full_chroma_int",
            )
        if tags and not yuv:  # RGB has no matrix and all levels
            tags |= {"colorspace": "gbr", "range": "pc"}
        if tags:
            picture = picture.filter("setparams", **tags)
        # FFV1 would have video levels written unless the other ones are asked for.
        levels = {"color_range": tags["range"]} if yuv else {}
        return into(
            path,
            picture,
            **levels,
            threads=THREADS,
            fflags="+bitexact",
            pix_fmt=there,
            **{"flags:v": "+bitexact"},
            **self.codec.encoder,
        )
