"""Loudness and true peak of audio, by ffmpeg's ebur128, and a limiter of true peaks."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import av
import av.filter
import numpy as np

from dubbing.engine.disk.files import atomic_path
from dubbing.errors import MediaError
from dubbing.media.opening.ffmpeg import run
from dubbing.media.opening.opening import LAYOUTS, into, source

SILENT = -70.0  # LUFS; the absolute gate of BS.1770: below it nothing counts
FINER = 192000  # Hz, at which peaks between samples are measured
MARGIN = 0.3  # dB that resampling back may add


@dataclass(frozen=True)
class Loudness:
    """Integrated loudness (LUFS; None for silence, or less than 0.4 s) and true peak (dBTP)."""

    integrated: float | None
    true_peak: float | None


def measure(blocks: Iterable[np.ndarray], rate: int) -> Loudness:
    """Loudness of audio in blocks (samples, C) float32, `rate` samples a second.

    Raises:
        MediaError: ffmpeg cannot measure it.
    """
    graph: av.filter.Graph | None = None
    figures: dict[str, str] = {}
    at = 0
    for block in blocks:
        channels = block.shape[1]
        if graph is None:
            graph = av.filter.Graph()
            layout = LAYOUTS[channels]
            arguments = f"sample_rate={rate}:sample_fmt=flt:channel_layout={layout}"
            steps = [
                graph.add("abuffer", f"{arguments}:time_base=1/{rate}"),
                graph.add("ebur128", "peak=true:metadata=1:framelog=quiet"),
                graph.add("abuffersink"),
            ]
            graph.link_nodes(*steps).configure()
        samples = np.ascontiguousarray(block, np.float32).reshape(1, -1)
        frame = av.AudioFrame.from_ndarray(samples, format="flt", layout=LAYOUTS[channels])
        frame.sample_rate, frame.pts = rate, at
        at += len(block)
        try:
            graph.push(frame)
            figures |= _pulled(graph)
        except av.FFmpegError as error:
            raise MediaError("its loudness cannot be measured", "", str(error)) from error
    if graph is not None:
        graph.push(None)
        figures |= _pulled(graph)
    loudness = float(figures.get("lavfi.r128.I", SILENT))
    peaks = [float(v) for k, v in figures.items() if k.startswith("lavfi.r128.true_peaks_ch")]
    peak = max(peaks, default=0.0)
    return Loudness(
        loudness if loudness > SILENT else None,
        round(float(20 * np.log10(peak)), 2) if peak > 0 else None,
    )


def _pulled(graph: av.filter.Graph) -> dict[str, str]:
    """The newest figures of the graph."""
    figures: dict[str, str] = {}
    while True:
        try:
            figures |= graph.pull().metadata
        except (av.BlockingIOError, av.EOFError):
            return figures


def limit(path: Path, out: Path, peak: float) -> None:
    """Write a FLAC of an audio file, with true peaks limited to ``peak`` dBTP.

    Raises:
        MediaError: ffmpeg failed.
    """
    with atomic_path(out) as temporary:
        rate = 48000
        sound = source(path).audio.filter("aresample", FINER)
        ceiling = 10 ** ((peak - MARGIN) / 20)
        sound = sound.filter("alimiter", limit=f"{ceiling:.6f}", level="false", latency="true")
        sound = sound.filter("aresample", rate)
        run(into(temporary, sound, acodec="flac", sample_fmt="s32"), str(out))
