"""Clips that many tests read: numbered frames, and the synthetic speaker in known sync."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.batch import task
from dubbing.engine.forks import load_beforehand
from dubbing.media import VideoWriter
from dubbing.workshop.synthetic.speaker import make_speaker
from tests import clips, fakes
from tests.dubbing.studio.browser import Browser, browser

# In whichever test the first process is started.
load_beforehand((*task.LOADED, "tests.fakes", "tests.dubbing.studio.stand_in"))

TEXT = "The quick brown fox jumps over the lazy dog, and then we walked back home."
RATE = Fraction(25)


@pytest.fixture(scope="session")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with clips of ``ann``, ``bob`` and ``noface``, half a clip, and speech."""
    folder = tmp_path_factory.mktemp("footage")
    clips.write_clip(folder / "ann.mp4", 30)
    clips.write_clip(folder / "bob.mp4", 30)
    clips.write_clip(folder / "noface.mp4", 30)
    clips.write_sound(folder / "it.wav", 1.6)
    whole = (folder / "bob.mp4").read_bytes()
    (folder / "damaged.mp4").write_bytes(whole[: len(whole) // 3])
    return folder


@pytest.fixture(scope="module")
def running_chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Headless Chromium; skips where it is not installed."""
    with browser(tmp_path_factory.mktemp("profile")) as found:
        yield found


@pytest.fixture
def chromium(running_chromium: Browser) -> Iterator[Browser]:
    """The same without pages. Those of a test do not go on looking for its server after it."""
    yield running_chromium
    running_chromium.close_pages()


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stages that do no work: each leaves files as the true one would."""
    fakes.install(monkeypatch.setattr)


@pytest.fixture
def flushed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Path]]:
    """In their order: what is flushed to the disk, and the new names that files are given."""
    found: list[tuple[str, Path]] = []
    opened: dict[int, Path] = {}
    really = {name: getattr(os, name) for name in ("open", "fsync", "replace", "rename")}

    def note_open(path: Path, *arguments: Any, **named: Any) -> int:
        handle: int = really["open"](path, *arguments, **named)
        opened[handle] = Path(path)
        return handle

    def fsync(handle: int) -> None:
        found.append(("flushed", opened[handle]))
        really["fsync"](handle)

    def move(name: str) -> Callable[[Path, Path], None]:
        def moved(old: Path, new: Path) -> None:
            found.append(("named", Path(new)))
            really[name](old, new)

        return moved

    monkeypatch.setattr(os, "open", note_open)
    monkeypatch.setattr(os, "fsync", fsync)
    for name in ("replace", "rename"):
        monkeypatch.setattr(os, name, move(name))
    return found


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


@pytest.fixture(scope="session")
def people(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """Frames (20, 128, 128, 3) of three people who do not look alike, at 24000/1001 a second."""
    made = {}
    for name in ("alba", "chidi", "dora"):
        folder = tmp_path_factory.mktemp(name)
        rate = Fraction(24000, 1001)
        make_speaker(folder, text="Good evening.", seconds=0.83, size=128, rate=rate, face=name)
        made[name] = np.stack(list(media.read_frames(folder / "clip.mp4")))
    return made
