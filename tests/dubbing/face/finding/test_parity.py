"""Faces and people as the library finds them that the networks come from, where it is installed."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from dubbing.face.finding.face_finder import FaceFinder
from dubbing.face.finding.graph_network import network
from dubbing.face.finding.hand_finder import HandFinder
from dubbing.face.finding.landmark_network import SIZE, LandmarkNetwork
from dubbing.face.finding.regions import Images, Region
from dubbing.face.mesh_points import LANDMARKS
from dubbing.face.weight_paths import FACE_LANDMARKS
from dubbing.media import read_frames
from dubbing.preparation.matting.masks import INPUT_SIDE, person_masks
from dubbing.workshop.true_dubs import objects
from tests import needs

pytestmark = pytest.mark.medium
needs.mediapipe()
solutions = import_module("mediapipe.python.solutions")

GRAPH = "mediapipe/modules/face_landmark/face_landmark_front_cpu.binarypb"
# px at the size of the network's input: median and worst of points. Where each frame is looked at
# as the frame before tells, rounding adds up.
STATIC, FOLLOWED = (0.01, 0.1), (0.1, 1.0)
CLIPS = ("andrew1_256", "aoc", "cnn2", "french", "latentsync2", "may", "menendez", "vr4_woman")
FRAMES = 60


class Published:
    """The published graph, in tracking or static mode."""

    def __init__(self, *, tracking: bool, faces: int) -> None:
        settings = {"num_faces": faces, "with_attention": True, "use_prev_landmarks": tracking}
        self._graph = solutions.face_mesh.SolutionBase(
            binary_graph_path=GRAPH,
            side_inputs=settings,
            outputs=["multi_face_landmarks", "face_rects_from_landmarks"],
        )

    def __call__(self, frame: np.ndarray) -> tuple[list[np.ndarray], list[Region]]:
        """Points of the faces of a frame, and where they are looked for in the next one."""
        height, width = frame.shape[:2]
        found = self._graph.process({"image": np.ascontiguousarray(frame)})
        scale = np.array([width, height, width])
        faces = [points(face) * scale for face in found.multi_face_landmarks or []]
        return faces, [
            Region(r.x_center * width, r.y_center * height, r.width * width, r.rotation)
            for r in found.face_rects_from_landmarks or []
        ]


def points(face: Any) -> np.ndarray:
    return np.array([(p.x, p.y, p.z) for p in face.landmark])


def check(
    pairs: Sequence[tuple[list[np.ndarray], list[np.ndarray]]], bounds: tuple[float, float]
) -> None:
    """Faces (ours, published) of frames have the same number and places."""
    distances = []
    for ours, theirs in pairs:
        assert len(ours) == len(theirs)
        for one, other in zip(ours, theirs, strict=True):
            assert one.shape == (LANDMARKS, 3)
            scale = SIZE / (1.5 * np.ptp(other[:, :2], axis=0).max())
            distances.append(np.linalg.norm(one - other, axis=1) * scale)
    assert distances
    assert np.median(distances) < bounds[0]
    assert np.max(distances) < bounds[1]


def check_both_modes(frames: Images, faces: int) -> None:
    ours, published = FaceFinder(faces), Published(tracking=False, faces=faces)
    check([(ours.find([frame])[0], published(frame)[0]) for frame in frames], STATIC)
    published = Published(tracking=True, faces=faces)
    check([(ours.follow(frame), published(frame)[0]) for frame in frames], FOLLOWED)


def check_masks(frames: Images) -> None:
    published = solutions.selfie_segmentation.SelfieSegmentation(model_selection=0)
    for frame, mask in zip(frames, person_masks(frames), strict=True):
        small = cv2.resize(frame, (INPUT_SIDE, INPUT_SIDE), interpolation=cv2.INTER_AREA)
        theirs = cv2.resize(published.process(small).segmentation_mask, frame.shape[1::-1])
        assert np.abs(mask - theirs).mean() < 1 / 255


def test_faces_of_the_synthetic_speakers(people: dict[str, np.ndarray]) -> None:
    for frames in people.values():
        check_both_modes(frames, 1)


def test_two_faces_in_a_frame_of_another_shape(people: dict[str, np.ndarray]) -> None:
    pairs = zip(people["alba"], people["chidi"], strict=True)
    check_both_modes([cv2.resize(np.hstack(pair), (600, 280)) for pair in pairs], 4)


def test_the_same_regions_show_the_same_landmarks(people: dict[str, np.ndarray]) -> None:
    published, ours = Published(tracking=True, faces=1), LandmarkNetwork(network(FACE_LANDMARKS))
    regions: list[Region] = []
    pairs = []
    for frame in people["dora"]:
        faces, following = published(frame)
        found = ours([(frame, region) for region in regions])
        pairs += [([p], faces) for p in found if p is not None]
        regions = following
    check(pairs, STATIC)


def test_masks_of_the_synthetic_speakers(people: dict[str, np.ndarray]) -> None:
    for frames in people.values():
        check_masks(frames[::5])


@pytest.fixture(params=CLIPS)
def clip(request: pytest.FixtureRequest) -> list[np.ndarray]:
    path: Path = needs.shared("clips") / f"{request.param}.mp4"
    return list(islice(read_frames(path), FRAMES))


@pytest.mark.slow
def test_real_clips(clip: list[np.ndarray]) -> None:
    check_both_modes(clip, 1)
    check_masks(clip[::10])


def test_hands(people: dict[str, np.ndarray]) -> None:
    """Each frame by itself: `max_num_hands` of the published graph counts those it follows."""
    size = 2 * people["alba"].shape[1]
    frames = [
        objects.hand(t, np.array([size / 2, size / 2]), size).over(cv2.resize(image, (size, size)))
        for t, image in zip(range(145, 166, 5), people["alba"], strict=False)
    ]
    published = solutions.hands.Hands(static_image_mode=True, model_complexity=0)
    distances = []
    for frame in frames:
        (some,) = HandFinder().follow([frame])
        (ours,) = some
        (theirs,) = published.process(frame).multi_hand_landmarks
        flat = np.array([(p.x, p.y) for p in theirs.landmark]) * size
        distances.append(np.linalg.norm(ours[:, :2] - flat, axis=1))
    assert np.median(distances) < 0.1
    assert np.max(distances) < 0.5
