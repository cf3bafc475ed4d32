"""Stand-ins for the stages that need a face or a trained model: quick, exact, resumable.

``python -m tests.fakes dub MANIFEST`` is ``dfrf`` with them; DFRF_TEST_KILL=stage:n makes it kill
itself (SIGKILL) the n-th time that stage reports progress.
"""

from __future__ import annotations

import os
import signal
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from dubbing import media
from dubbing.batch import task as batch_task
from dubbing.compositing.grade import NEUTRAL
from dubbing.compositing.lip_colour import SAME
from dubbing.engine.disk.files import atomic_write_json, atomic_write_text
from dubbing.errors import PreparationError
from dubbing.face.mesh_points import FACE_OVAL, LEFT_EYE_OUTER, NOSE, NOSE_BASE, RIGHT_EYE_OUTER
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.preparation.prepared import BACKGROUND, MATTE, PreparedClip
from dubbing.script import timeline
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue
from dubbing.stages.check import Check
from dubbing.stages.check_source import CheckSource
from dubbing.stages.composite import Composite
from dubbing.stages.draft import HalfSize
from dubbing.stages.finetune import Finetune
from dubbing.stages.prepare import Prepare
from dubbing.stages.refine_poses import RefinePoses
from dubbing.stages.render import Render
from dubbing.sync.records import SYNC_FILE
from dubbing.video import assembly

SIZE = 32
HEADS_A_FILE = 5
HEAD = (200, 30, 90)  # colour of every fake head


def write_prepared(
    clip: Path,
    out: Path,
    *,
    window: tuple[int, int, int] = (8, 4, 32),
    size: int = SIZE,
    segment: np.ndarray | None = None,
    invalid: tuple[int, ...] = (),
) -> PreparedClip:
    """A prepared clip whose head is a square in the middle of the crop, background plain green."""
    info = media.probe(clip)
    frames = info.frames
    matte = np.zeros((size, size), np.uint8)
    matte[size * 3 // 8 : size * 5 // 8, size * 3 // 8 : size * 5 // 8] = 255
    plain = np.full((size, size, 3), (10, 200, 10), np.uint8)
    for name, codec, picture in ((MATTE, "ffv1-gray", matte), (BACKGROUND, "ffv1", plain)):
        with media.VideoWriter(out / name, size, size, info.rate, codec) as writer:
            for _ in range(frames):
                writer.write(picture)
    valid = np.ones(frames, bool)
    valid[list(invalid)] = False
    prepared = PreparedClip(
        folder=out,
        clip=clip,
        rate=info.rate,
        frames_count=frames,
        part=(0, frames),
        size=size,
        source_size=(info.width, info.height),
        focal=2.34 * size,
        near=5.0,
        far=9.0,
        warnings=[],
        face_warnings=[],
        residual_shift=0.1,
        rotation=np.tile(np.eye(3), (frames, 1, 1)),
        translation=np.tile([0.0, 0.0, 7.0], (frames, 1)),
        centre=np.full((frames, 2), size / 2),
        crop=np.tile(np.array([*window, 0.0]), (frames, 1)),
        valid=valid,
        detected=valid,
        covered=np.zeros(frames, bool),
        over=np.zeros(frames, bool),
        shown=np.ones(frames, np.float32),
        haze=np.zeros((frames, 3)),
        noise=np.zeros((frames, 5)),
        segment=np.zeros(frames, int) if segment is None else segment,
        landmarks=np.tile(face(size), (frames, 1, 1)),
        lip_shift=np.zeros((frames, 40, 2)),
        shape=np.zeros((478, 3)),
    )
    prepared.save()
    return prepared


def face(size: int = SIZE) -> np.ndarray:
    """Landmarks (478, 2) px of a face that is a circle round the fake head, and mostly mouth.

    So there is no skin that film and head both show, and heads keep their colour; see
    `dubbing.compositing.light`.
    """
    landmarks = np.full((478, 2), size / 2)
    for points, radius in ((FACE_OVAL, size / 3), (OUTER_LIP, 0.3 * size)):
        angle = np.arange(len(points)) * 2 * np.pi / len(points)
        landmarks[list(points)] += radius * np.stack([np.sin(angle), -np.cos(angle)], -1)
    landmarks[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]] += size / 6 * np.array([[-1, -1.5], [1, -1.5]])
    landmarks[NOSE_BASE] -= (0, size / 8)
    landmarks[list(NOSE)] -= (0, size / 4)  # a dot between the eyes
    return landmarks


def talking_face(size: int = SIZE) -> np.ndarray:
    """The same with a mouth of the usual size, two thirds down the face."""
    landmarks = face(size)
    angle = np.arange(len(OUTER_LIP)) * 2 * np.pi / len(OUTER_LIP)
    lips = np.stack([0.5 + 0.08 * np.sin(angle), 0.645 - 0.03 * np.cos(angle)], -1)
    landmarks[list(OUTER_LIP)] = size * lips
    return landmarks


def write_heads(out: Path, frames: int, rate: Fraction, size: int = SIZE) -> None:
    """Opaque squares of one colour, a little larger than the matte, brighter with every frame."""
    for first in range(0, frames, HEADS_A_FILE):
        path = out / f"{first:06d}.mkv"
        if not path.exists():
            with media.VideoWriter(path, size, size, rate, "ffv1-rgba") as writer:
                for k in range(first, min(first + HEADS_A_FILE, frames)):
                    writer.write(head(k, size))


def head(k: int, size: int = SIZE) -> np.ndarray:
    """Fake head k, premultiplied RGBA."""
    picture = np.zeros((size, size, 4), np.uint8)
    part = slice(size * 5 // 16, size * 11 // 16)
    picture[part, part] = (*HEAD[:2], k % 256, 255)
    return picture


class Killer:
    """Counts the progress of a stage and kills this process at the asked moment."""

    def __init__(self) -> None:
        stage, _, count = os.environ.get("DFRF_TEST_KILL", "").partition(":")
        self.stage, self.left = stage, int(count or 0)

    def __call__(self, stage: str) -> None:
        if stage == self.stage:
            self.left -= 1
            if self.left <= 0:
                os.kill(os.getpid(), signal.SIGKILL)


def install(patch: Any) -> None:
    """Put the stand-ins in place with ``patch(object, name, value)`` (as monkeypatch.setattr)."""
    kill = Killer()

    def prepare(self: Prepare, out: Path, progress: Any) -> None:
        kill("prepare")
        if "noface" in self.clip.name:
            raise PreparationError("no face found", self.clip.name, "film the face")
        (out / "landmarks.npz").write_bytes(b"kept work")
        kill("prepare")
        right = any(x > 0.5 for _, x, _ in (self.people[0].points if self.people else ()))
        write_prepared(self.clip, out, window=(32 if right else 8, 4, 32))
        kill("prepare")

    def finetune(self: Finetune, out: Path, progress: Any) -> None:
        (out / "resume").mkdir(exist_ok=True)
        for step in range(1, 7):
            mark = out / "resume" / f"{step}.txt"
            if not mark.exists():
                atomic_write_text(mark, str(step))
                kill("finetune")
        for clip in self.clips:
            clip.prepared.load()
        atomic_write_text(out / "model.safetensors", f"seed {self.settings.seed}")
        learned = [[0.0, self.seconds]]
        beside = [[clip.prepared.clip.name, learned] for clip in self.clips[1:]]
        summary = {"steps": 6, "seconds": 1.0, "clip": "", "learned": learned, "beside": beside}
        turned: list[list[float]] = [[] for _ in self.clips]
        atomic_write_json(out / "finetune.json", summary | {"turned": turned})
        atomic_write_text(out / "loss.csv", "step,loss,psnr,seconds\n1,0.5,20,1\n2,0.25,22,2\n")

    def render(self: Render, out: Path, progress: Any) -> None:
        # Loads torch, which takes the processes of other stages seconds.
        from dubbing.sound_to_lips.cue_speech import Speech

        clip = self.prepared.load()
        poses = timeline.pose_index(self.stop, clip.segment, self.film_first, self.on_longer_audio)
        frames = len(poses[self.first :])
        cut = self.on_longer_audio == "cut"
        assert cut or Speech.load(self.speech.folder).frames == frames
        for count in range(HEADS_A_FILE, frames + HEADS_A_FILE, HEADS_A_FILE):
            write_heads(out, min(count, frames), clip.rate, clip.size)
            kill("render")

    def refine_poses(self: RefinePoses, out: Path, progress: Any) -> None:
        kill("refine_poses")
        clip = self.prepared.load()
        np.savez(out / "poses.npz", c2w=clip.c2w())
        found = {name: getattr(clip, name) for name in ("over", "covered", "landmarks")}
        found |= {"jaw": np.zeros((len(clip), 48)), "grade": np.tile(NEUTRAL, (len(clip), 1))}
        found |= {"lip_colour": np.tile(SAME, (len(clip), 1))}
        np.savez(out / "covers.npz", allow_pickle=False, **found)

    def compose(self: Composite, out: Path, progress: Any) -> None:
        def reporting(message: str, share: float) -> None:
            progress(message, share)
            kill("mux" if message == "muxing" else "composite")

        real_compose(self, out, reporting)

    def rendered(self: HalfSize, cue: Cue, edit: Edit) -> Any:
        size = self.clips[cue.identity].size
        return lambda first, count: (head(k, size) for k in range(first, first + count))

    def check(self: Check | CheckSource, out: Path, progress: Any) -> None:
        verdict = "fail" if "fellshort" in str(self.folder) else "pass"
        found = {"verdict": verdict, "reason": "measured", "words": "in sync", "curve": [1, 0, 1]}
        figures = {"offset_frames": 0, "offset_ms": 0.0, "confidence": 2.0, "distance": 1.0}
        atomic_write_json(out / SYNC_FILE, {**found, **figures, "source": None})

    real_compose = Composite.run
    for stage, stand_in in (
        *((Prepare, prepare), (Finetune, finetune), (RefinePoses, refine_poses)),
        *((Render, render), (Composite, compose), (Check, check), (CheckSource, check)),
    ):
        patch(stage, "run", stand_in)
    patch(HalfSize, "_rendered", rendered)
    patch(assembly, "SEGMENT", 10)
    patch(batch_task, "MODULE", "tests.fakes")


def main(argument: str) -> int:
    """Do the task of a process that a run has started."""
    install(setattr)
    return batch_task.main(argument)


if __name__ == "__main__":
    install(setattr)
    if sys.argv[1].startswith("{"):  # the call of a task, on a worker of Dask
        sys.exit(batch_task.main(sys.argv[1]))
    from dubbing.cli.main import main as command_line

    command_line()
