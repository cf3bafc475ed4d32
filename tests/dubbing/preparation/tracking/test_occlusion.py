"""Faces that look alike and not, and mouths that something covers: on the synthetic speaker."""

from __future__ import annotations


import cv2
import numpy as np
import pytest

from dubbing import media
from dubbing.face.landmarks import FaceMesh
from dubbing.preparation.tracking.likeness import FARTHEST, apart, looks
from dubbing.preparation.tracking.occlusion import AROUND, covered_step
from dubbing.preparation.tracking.procrustes import head_frame, mean_shape
from dubbing.synthetic.speaker import make_speaker

FRAMES, SIZE = 30, 128
HIDDEN = np.arange(12, 18)
MOUTH = (61, 291, 0, 17)


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """Frames (T, S, S, 3) of two people."""
    made = {}
    for name in ("alba", "bruno"):
        folder = tmp_path_factory.mktemp(name)
        make_speaker(folder, text="Good evening to you.", seconds=1.2, size=SIZE, face=name)
        made[name] = np.stack(list(media.read_frames(folder / "clip.mp4")))
    return made


def meshes(frames: np.ndarray) -> np.ndarray:
    with FaceMesh(tracking=False) as mesh:
        return np.stack([mesh(frame)[0] for frame in frames])


def test_parts_of_one_person_are_nearer_than_other_people(people: dict[str, np.ndarray]) -> None:
    seen = {}
    for name, frames in people.items():
        some = frames[::5]
        darker = (some[3:] * np.array([0.92, 0.88, 0.84])).astype(np.uint8)
        for part, pictures in (("first", some[:3]), ("last", darker)):
            found = zip(pictures, meshes(pictures), strict=True)
            seen[name, part] = np.stack([looks(*pair) for pair in found])
    for name, other in (("alba", "bruno"), ("bruno", "alba")):
        own = apart(seen[name, "first"], seen[name, "last"])
        assert own < FARTHEST < apart(seen[name, "first"], seen[other, "last"])


@pytest.mark.parametrize("kind", ["hand", "microphone", "scarf", "nothing"])
def test_what_lies_over_a_mouth_is_found(people: dict[str, np.ndarray], kind: str) -> None:
    frames = people["alba"].copy()
    clean = meshes(frames)
    if kind != "nothing":
        skin = frames[0][tuple(clean[0, 151, 1::-1].round().astype(int))]
        colour = {"hand": 0.85 * skin, "microphone": (30, 30, 34), "scarf": (40, 90, 200)}[kind]
        for t in HIDDEN:
            middle = clean[t, list(MOUTH), :2].mean(0) + 2
            wide = 0.4 * float(np.ptp(clean[t, :, 0])) * np.array([0.7, 0.9])
            place = (tuple(map(float, middle)), tuple(map(float, wide)), 20.0)
            cv2.ellipse(frames[t], place, tuple(map(float, colour)), -1)
    points = meshes(frames)
    shape = head_frame(mean_shape(points, tuple(range(468))))
    valid, one = np.ones(FRAMES, bool), np.zeros(FRAMES, int)
    found = covered_step(frames, points, valid, one, shape, lambda share: None)["covered"]
    expected = np.zeros(FRAMES, bool)
    if kind != "nothing":
        expected[HIDDEN[0] - AROUND : HIDDEN[-1] + AROUND + 1] = True
    np.testing.assert_array_equal(found, expected)
