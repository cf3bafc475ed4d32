"""The rendered frames of a film, before a camera or an object adds to them.

T frames of side S. Scenes that differ in their look alone share one rendering.
"""

import hashlib
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from dubbing.engine.disk.files import atomic_path
from dubbing.media import VideoWriter, read_frames
from dubbing.workshop.synthetic.anatomy.face import face_by_name
from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.motion import Motion, move
from dubbing.workshop.synthetic.rendering.camera import Pose
from dubbing.workshop.synthetic.rendering.render import REST_SHIFT, Renderer, State
from dubbing.workshop.synthetic.speaker import fit_phones, place_sound
from dubbing.workshop.synthetic.visemes import Phone, mouth_curves
from dubbing.workshop.synthetic.voice import synthesise
from dubbing.workshop.true_dubs.scenes import DUBBED, FRAMES, LEARNED, RATE, Scene

VOICE = "en-us+f3"
SENTENCES = {
    "learned": "We have been warm and dry all week; how was your weather? Please bring me a map, "
    "some bread, and a pound of plums.",
    "a": "Five boys waved from the bank, and went home to bed.",
    "b": "My mother bought a blue umbrella on a bright day in May.",
}
SEED = 3
SUBFRAMES = 4  # of a frame whose shutter is open for long
FRAME_RATE = Fraction(RATE)


@dataclass(frozen=True)
class Speech:
    """Sound (N,) of a sentence at `rate` Hz, cut or padded to its length, and its phones."""

    sound: np.ndarray
    rate: int
    phones: list[Phone]


@dataclass(frozen=True)
class Rendered:
    """Files of a film's frames, lossless, and what is true of them.

    Attributes:
        picture, person: frames, and mattes of the body.
        mouths: (T, 2, 2) px: middle of the mouth, and half its width and height.
        opening: (T,) gap between the lips, units of 10 cm.
    """

    picture: Path
    person: Path
    mouths: np.ndarray
    opening: np.ndarray

    def frames(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Frames (S, S, 3) and mattes of the body (S, S), one by one."""
        yield from zip(
            read_frames(self.picture), read_frames(self.person, pixels="gray"), strict=True
        )


def speech(name: str) -> Speech:
    """A sentence as long as the part of the film in which it is said."""
    seconds = LEARNED if name == "learned" else DUBBED
    samples, rate, phones = synthesise(SENTENCES[name], VOICE)
    return Speech(place_sound(samples, rate, seconds), rate, fit_phones(phones, seconds))


def film_phones(name: str) -> list[Phone]:
    """Phones of a film whose dubbed part says sentence ``name``."""
    after = [Phone(p.symbol, p.start + LEARNED, p.end + LEARNED) for p in speech(name).phones]
    return [*speech("learned").phones, *after]


def rendered(scene: Scene, name: str, folder: Path) -> Rendered:
    """The frames of a scene in which sentence ``name`` is said; made once.

    Args:
        folder: of the renderings of all scenes.
    """
    what = repr((scene.face, scene.turns().tolist(), scene.motion, scene.light, scene.size))
    what += repr((scene.zoom, scene.look.blur, name, SENTENCES))
    out = folder / hashlib.sha256(what.encode()).hexdigest()[:16]
    files = [out / f"{part}.mkv" for part in ("picture", "person")]
    truth = out / "truth.npz"
    if not truth.exists():
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        _render(scene, name, files, truth)
    with np.load(truth) as known:
        return Rendered(files[0], files[1], known["mouths"], known["opening"])


def _render(scene: Scene, name: str, files: list[Path], truth: Path) -> None:
    curves = mouth_curves(film_phones(name), FRAMES, FRAME_RATE)
    # The head nods with the words of A, whatever is said.
    beat = mouth_curves(film_phones("a"), FRAMES, FRAME_RATE)[:, 0]
    motion = move(
        FRAMES,
        FRAME_RATE,
        seed=SEED,
        rest=REST_SHIFT,
        opening=beat,
        amount=scene.motion,
        turns=scene.turns(),
    )
    renderer = Renderer(face_by_name(scene.face), scene.size, scene.zoom, scene.light)
    mouths, opening = np.zeros((FRAMES, 2, 2)), np.zeros(FRAMES)
    size = scene.size
    with (
        VideoWriter(files[0], size, size, FRAME_RATE, "ffv1") as pictures,
        VideoWriter(files[1], size, size, FRAME_RATE, "ffv1-gray") as people,
    ):
        for t, shape in enumerate(curves):
            shots = [
                renderer.render(
                    State(
                        pose,
                        MouthShape(*shape),
                        float(motion.blink[t]),
                        (float(motion.gaze[t, 0]), float(motion.gaze[t, 1])),
                    )
                )
                for pose in shutter(motion, t, scene.look.blur)
            ]
            for writer, part in ((pictures, "image"), (people, "person")):
                mean = np.mean([getattr(shot, part) for shot in shots], 0)
                writer.write(mean.round().astype(np.uint8))
            opening[t] = shots[0].opening
            points = renderer.model.mouth_box()
            pixels = renderer.project(motion.poses[t], points)
            low, high = pixels.min(0), pixels.max(0)
            mouths[t] = (low + high) / 2, (high - low) / 2
    with atomic_path(truth) as temporary, temporary.open("wb") as file:
        np.savez(file, mouths=mouths, opening=opening)


def shutter(motion: Motion, t: int, share: float) -> list[Pose]:
    """Poses of the head while the shutter of frame t is open for a share of the frame's time."""
    poses = motion.poses
    if not share or t + 1 == len(poses):
        return [poses[t]]
    ends = poses[t], poses[t + 1]
    between = Slerp([0, 1], Rotation.from_matrix(np.stack([p.rotation for p in ends])))
    return [
        Pose(between(x).as_matrix(), (1 - x) * ends[0].translation + x * ends[1].translation)
        for x in np.linspace(0, share, SUBFRAMES)
    ]
