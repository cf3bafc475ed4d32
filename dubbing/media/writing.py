"""Writes frames to a video file, through an ffmpeg that encodes in parallel."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from dubbing.engine.files import atomic_path
from dubbing.errors import MediaError
from dubbing.media.colour import Colour
from dubbing.media.ffmpeg import Process
from dubbing.media.opening import Graph, into, piped
from dubbing.media.reading import CHANNELS

# x264's result depends on its number of threads: a fixed one gives the same file everywhere.
THREADS = 4


@dataclass(frozen=True)
class Codec:
    """How frames are encoded. ``pixels``: format of frames; ``even``: 4:2:0 needs even sides."""

    pixels: str
    options: dict[str, Any] = field(default_factory=dict)
    yuv: bool = False
    full_range: bool = True
    even: bool = False


CODECS = {
    "h264": Codec(
        "rgb24",
        {"vcodec": "libx264", "pix_fmt": "yuv420p", "crf": 16, "preset": "veryfast"},
        yuv=True,
        even=True,
    ),
    "prores": Codec(
        "rgb24",
        {"vcodec": "prores_ks", "profile:v": "hq", "pix_fmt": "yuv422p10le", "vendor": "apl0"},
        yuv=True,
        full_range=False,
        even=True,
    ),
    "ffv1": Codec("rgb24", {"vcodec": "ffv1", "level": 3, "slices": 4, "pix_fmt": "bgr0"}),
    "ffv1-rgba": Codec("rgba", {"vcodec": "ffv1", "level": 3, "slices": 4, "pix_fmt": "bgra"}),
    "ffv1-gray": Codec("gray", {"vcodec": "ffv1", "level": 3, "slices": 4, "pix_fmt": "gray"}),
}

SUFFIX = {"h264": ".mp4", "prores": ".mov", "ffv1": ".mkv"}  # of files for people


class VideoWriter:
    """Context manager: ``write`` frames; the complete file appears when the block ends well.

    ``codec``: ``h264`` (crf 16, 4:2:0) and ``prores`` (422 HQ) for people, ``ffv1`` (RGB),
    ``ffv1-rgba`` and ``ffv1-gray`` lossless. An odd side of a 4:2:0 picture is made even by
    repeating its last line. ``colour``: colour space of the frames, BT.709 by default; ProRes
    always has video levels. The bytes of the file depend only on the frames and on ffmpeg.

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
    ) -> None:
        self.path = Path(path)
        self.codec = CODECS[codec]
        self.frames = 0
        self.shape = (height, width, *CHANNELS[self.codec.pixels])
        self._pad = [(0, height % 2), (0, width % 2), (0, 0)] if self.codec.even else []
        extra = (width % 2, height % 2) if self.codec.even else (0, 0)
        self._size = (width + extra[0], height + extra[1])
        self._rate = rate
        self._colour = colour
        self._stack = ExitStack()
        self._process: Process | None = None

    def __enter__(self) -> VideoWriter:
        temporary = self._stack.enter_context(atomic_path(self.path))
        graph = self._graph(temporary)
        self._process = self._stack.enter_context(Process(graph, str(self.path), pipe_in=True))
        return self

    def write(self, frame: np.ndarray) -> None:
        """Add one uint8 frame: (H, W, 3) RGB, (H, W, 4) RGBA or (H, W), as the codec needs."""
        assert self._process is not None, "write() outside of the with block"
        if frame.shape != self.shape or frame.dtype != np.uint8:
            raise MediaError(
                f"a frame is {frame.dtype}{list(frame.shape)}, not uint8{list(self.shape)}",
                str(self.path),
            )
        if any(after for _, after in self._pad):
            frame = np.pad(frame, self._pad, mode="edge")
        try:
            self._process.stdin.write(np.ascontiguousarray(frame).data.cast("B"))
        except BrokenPipeError:
            self._process.finish()
            raise
        self.frames += 1

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None and self._process is not None:
                if self.frames == 0:
                    raise MediaError("no frames were written", str(self.path))
                self._process.finish()
        except MediaError as problem:
            self._stack.__exit__(type(problem), problem, problem.__traceback__)
            raise
        self._stack.__exit__(kind, error, trace)

    def _graph(self, path: Path) -> Graph:
        width, height = self._size
        # `r` too: otherwise ffmpeg guesses from the times, 120 for 120000/1001.
        rates = {"framerate": f"{self._rate}", "r": f"{self._rate}"}
        picture = piped(pix_fmt=self.codec.pixels, s=f"{width}x{height}", **rates)
        colour = self._colour or Colour()
        if not self.codec.full_range:
            colour = replace(colour, full_range=False)
        tags = colour.tags() if self.codec.yuv or self._colour else {}
        if self.codec.yuv:
            picture = picture.filter(
                "scale",
                out_color_matrix=colour.matrix,
                out_range=tags["range"],
                flags="bicubic+accurate_rnd+full_chroma_int",
            )
        elif tags:  # RGB has no matrix and all levels
            tags |= {"colorspace": "gbr", "range": "pc"}
        if tags:
            picture = picture.filter("setparams", **tags)
        return into(
            path,
            picture,
            threads=THREADS,
            fflags="+bitexact",
            **{"flags:v": "+bitexact"},
            **self.codec.options,
        )
