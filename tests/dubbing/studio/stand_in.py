"""A scene with stand-ins for whatever needs a face, and the process that draws its frames."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import uvicorn
from PIL import Image
from starlette.testclient import TestClient

import dubbing.cli.main as cli
from dubbing.cli.page_commands import listening
from dubbing.manifest.manifest import load
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue
from dubbing.speech import labials
from dubbing.stages.draft import HalfSize
from dubbing.studio import drafting
from dubbing.studio.drafter import Drafter
from dubbing.studio.film import Film
from dubbing.studio.making import Making
from dubbing.studio.project import Project
from dubbing.studio.server import app_of
from tests import clips, fakes

FRAMES = 60
HERE = "http://127.0.0.1:8711"
DUB = "/api/dubs/it"
FIRST = "ann_0000005-0000020"  # the first line
TOKEN = "a-secret-of-tests"
SRT = """1
00:00:00,200 --> 00:00:00,800
ANN: One.

2
00:00:01,000 --> 00:00:01,400
BEN: Nobody dubs him.

3
00:00:01,600 --> 00:00:02,200
ANN: Three.
"""
MANIFEST = """version: 1
output: out
identities:
  ann: {{clip: film.mp4, seconds: 1, consent: {consent}}}
dubs:
  - {{name: it, lines: it.srt, speakers: {{ANN: ann}}, audio: track.wav}}
"""


def write_scene(folder: Path, frames: int = FRAMES) -> Path:
    """A manifest with all that it names."""
    clips.write_clip(folder / "film.mp4", frames)
    clips.write_sound(folder / "track.wav", frames / 25)
    (folder / "it.srt").write_text(SRT)
    path = folder / "m.yaml"
    path.write_text(MANIFEST.format(consent=clips.CONSENT))
    return path


def lips(self: HalfSize, cue: Cue, edit: Edit, strength: Any = None) -> np.ndarray:
    """Lips that open and close."""
    wave = 0.1 + 0.05 * np.sin(np.arange(cue.stop - cue.first))
    return np.full((len(wave), 7), 0.02) if strength is not None else np.tile(wave[:, None], 7)


def rendered(self: HalfSize, cue: Cue, edit: Edit) -> Any:
    """Heads that are the redder, the stronger their line is at that moment."""
    size, strengths = self.clips[cue.identity].size, edit.strengths(cue.stop - cue.first, cue_rate)

    def read(first: int, count: int) -> Iterator[np.ndarray]:
        for k in range(first, first + count):
            head = fakes.head(k, size)
            head[head[..., 3] > 0, 0] = round(40 + 140 * strengths[k])
            yield head

    return read


def measured(self: Film, number: int, image: np.ndarray) -> dict[str, float]:
    """An opening that is the wider, the redder an image is."""
    return {"opening": float(image[..., 0].mean()) / 1000, "width": 0.5}


cue_rate: Any = 25


def serve(pipe: Connection, manifest: str, device: str) -> None:
    """As `drafting.serve`, with stand-ins."""
    fakes.install(setattr)
    HalfSize._rendered = rendered  # type: ignore[method-assign]
    HalfSize.lips = lips  # type: ignore[method-assign]
    Film.measured = measured  # type: ignore[method-assign]
    labials.words_in = lambda blocks, words: [labials.Word("One", 0.12, 0.32)]
    drafting.closures_of = lambda cue, half: [0.12, 0.4]
    drafting.serve(pipe, manifest, device)


def main() -> None:
    """The command line, with stand-ins."""
    fakes.install(setattr)
    cli.main()


@contextmanager
def server(manifest: Path, port: int = 0) -> Iterator[str]:
    """The page's server in a thread; gives its address."""
    listener = listening("127.0.0.1", port)
    port = listener.getsockname()[1]
    drafter = Drafter(manifest, target=serve)
    own = {"token": TOKEN, "host": "127.0.0.1", "port": port, "password": False}
    making = Making(manifest, "auto", __name__)
    app = app_of(Project(load(manifest)), drafter, making, **own)
    running = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{port}/?token={TOKEN}"
    finally:
        running.should_exit = True
        thread.join()
        listener.close()


def image(data: bytes) -> np.ndarray:
    """A file as an image (H, W, 3)."""
    return np.asarray(Image.open(io.BytesIO(data)))


def client_of(manifest: Path, **guard: Any) -> TestClient:
    """A client of the server of a manifest, which others may guard differently."""
    drafter = Drafter(manifest, target=serve)
    own = {"token": TOKEN, "host": "127.0.0.1", "port": 8711, "password": False, **guard}
    making = Making(manifest, "auto", __name__)
    app = app_of(Project(load(manifest)), drafter, making, **own)
    return TestClient(app, HERE, headers={"origin": HERE}, follow_redirects=False)
