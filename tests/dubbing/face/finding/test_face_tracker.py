"""Faces keep their number whatever order they are found in."""

from functools import partial

import numpy as np
import pytest

from dubbing.face.finding.face_tracker import FaceTracker
from dubbing.face.finding.regions import Region
from dubbing.media.reading.late_frames import LateFrame
from tests.dubbing.sync.meshes import talk, turned

FACE = talk(np.zeros(1))[0]


@pytest.fixture
def tracker() -> FaceTracker:
    """A tracker without its face mesh: only the bookkeeping is tested."""
    made = FaceTracker.__new__(FaceTracker)
    made._memory, made._tracks, made._count, made._frame = 5, [], 0, -1
    made._meshes, made._begun, made._key, made._keys = [], "", "", 0
    return made


def numbers(tracker: FaceTracker, *columns: float) -> list[int]:
    tracker._frame += 1
    meshes = [turned(FACE[None], 0, 50, (c, 100))[0] for c in columns]
    return [face.track for face in tracker._assign(meshes)]


def test_order_does_not_matter(tracker: FaceTracker) -> None:
    assert numbers(tracker, 100, 400) == [0, 1]
    assert numbers(tracker, 405, 98) == [1, 0]
    assert numbers(tracker, 390) == [1]


def test_a_face_returns_within_a_moment_only(tracker: FaceTracker) -> None:
    assert numbers(tracker, 100, 400) == [0, 1]
    for _ in range(4):
        assert numbers(tracker, 400) == [1]
    assert numbers(tracker, 102, 400) == [0, 1]
    for _ in range(6):
        assert numbers(tracker, 400) == [1]
    assert numbers(tracker, 102, 400) == [2, 1]


def test_a_jump_is_another_face(tracker: FaceTracker) -> None:
    assert numbers(tracker, 100) == [0]
    assert numbers(tracker, 300) == [1]


def test_a_face_found_twice_is_one(tracker: FaceTracker) -> None:
    assert numbers(tracker, 100, 104, 400) == [0, 1]


class Finder:
    """Finds one face in every frame, in a region that is the frame's number."""

    def follow_on(self, regions: list[Region]) -> None:
        pass

    def detect(self, images: list[np.ndarray]) -> list[list[int]]:
        return [[int(image[0, 0, 0])] for image in images]

    def follow(self, image: np.ndarray, detected: list[int]) -> list[np.ndarray]:
        assert detected == [int(image[0, 0, 0])]
        return [turned(FACE[None], 0, 50, (100 + detected[0], 100))[0]]


def test_faces_are_detected_ahead_and_stay_with_their_frame(tracker: FaceTracker) -> None:
    tracker._finder = Finder()  # type: ignore[assignment]
    frames = [np.full((2, 2, 3), k, np.uint8) for k in range(11)]
    for part in (frames[:6], frames[6:]):
        late = [LateFrame("", partial(np.copy, frame)) for frame in part]
        tracked = list(tracker(late))
        for expected, (frame, _, (face,)) in zip(late, tracked, strict=True):
            assert frame is expected
            assert face.track == 0
