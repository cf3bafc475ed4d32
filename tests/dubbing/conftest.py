"""One small clip of the synthetic speaker, whose offset is known exactly."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.media import VideoWriter
from dubbing.synthetic.speaker import make_speaker

TEXT = "The quick brown fox jumps over the lazy dog, and then we walked back home."
RATE = Fraction(25)


@dataclass(frozen=True)
class Speaker:
    """A clip in sync, its frames (T, 96, 96, 3), and its sound at 16 kHz."""

    clip: Path
    frames: np.ndarray
    sound: np.ndarray


@pytest.fixture(scope="session")
def speaker(tmp_path_factory: pytest.TempPathFactory) -> Speaker:
    folder = tmp_path_factory.mktemp("speaker")
    make_speaker(folder, text=TEXT, seconds=4.0, size=96, rate=RATE, seed=1)
    clip = folder / "clip.mp4"
    return Speaker(clip, np.stack(list(media.read_frames(clip))), media.read_audio(clip))


@pytest.fixture
def sound_file(tmp_path: Path) -> Callable[[np.ndarray], Path]:
    """Writes a sound at 16 kHz to a file."""

    def write(samples: np.ndarray) -> Path:
        path = tmp_path / "sound.wav"
        soundfile.write(path, samples, 16_000)
        return path

    return write


@pytest.fixture
def silent_video(tmp_path: Path) -> Callable[[np.ndarray], Path]:
    """Writes frames (T, H, W, 3) to a video without sound."""

    def write(frames: np.ndarray) -> Path:
        path = tmp_path / "silent.mp4"
        with VideoWriter(path, frames.shape[2], frames.shape[1], RATE) as writer:
            for frame in frames:
                writer.write(np.ascontiguousarray(frame))
        return path

    return write
