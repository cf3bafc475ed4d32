"""Landmarks of the synthetic speakers, in both modes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dubbing.face.finding import chains
from dubbing.face.finding.landmarks import FaceMesh, combine, nearest

pytestmark = pytest.mark.medium

# Nose, chin, outer corners of the eyes, corners of the mouth, inner lips, irises.
SOME = [4, 152, 33, 263, 61, 291, 13, 14, 468, 473]
# Column, row and depth in px of the last frame, in tracking mode; MediaPipe 0.10.21 gives the same.
EXPECTED = {
    "alba": [
        *([58.2, 65.2, -11.4], [58.9, 92.8, 2.6], [45.1, 52.3, 4.6], [74.9, 52.8, 1.4]),
        *([51.0, 77.6, 1.9], [67.9, 77.7, 0.1], [58.9, 77.9, -3.2], [58.9, 77.9, -3.3]),
        *([49.2, 52.2, 2.3], [70.7, 52.8, 0.1]),
    ],
    "dora": [
        *([58.1, 65.4, -11.1], [58.8, 92.8, 2.0], [45.1, 52.4, 5.2], [75.3, 52.6, 0.9]),
        *([50.9, 77.6, 2.0], [67.7, 77.7, -0.5], [58.8, 78.0, -3.5], [58.8, 78.0, -3.4]),
        *([49.1, 52.3, 2.8], [70.7, 52.9, -0.3]),
    ],
}


@pytest.mark.parametrize("name", EXPECTED)
def test_points_lie_where_they_did(people: dict[str, np.ndarray], name: str) -> None:
    mesh = FaceMesh(tracking=True)
    found = [mesh(frame) for frame in people[name]][-1][0]
    np.testing.assert_allclose(found[SOME], EXPECTED[name], atol=0.3)
    (static,) = FaceMesh(tracking=False)(people[name][-1])
    np.testing.assert_allclose(static, found, atol=2)


def test_frames_together_give_what_they_give_alone(people: dict[str, np.ndarray]) -> None:
    frames, mesh = people["chidi"][:6], FaceMesh(tracking=False, faces=2)
    for together, alone in zip(mesh.find(frames), map(mesh, frames), strict=True):
        np.testing.assert_allclose(together, alone, atol=0.01)


def test_a_mirrored_view_of_a_frame_is_as_good_as_a_copy(people: dict[str, np.ndarray]) -> None:
    view, mesh = people["alba"][0][:, ::-1], FaceMesh(tracking=False)
    np.testing.assert_array_equal(mesh(view), mesh(view.copy()))


@pytest.mark.parametrize("degrees", range(0, 360, 30))
def test_a_head_is_found_any_way_up(people: dict[str, np.ndarray], degrees: int) -> None:
    frame, mesh = people["alba"][0], FaceMesh(tracking=False)
    middle = (len(frame) - 1) / 2
    turn = cv2.getRotationMatrix2D((middle, middle), degrees, 1)
    size = frame.shape[1::-1]
    turned = cv2.warpAffine(frame, turn, size, borderMode=cv2.BORDER_REPLICATE)
    (upright,) = mesh(frame)
    ((found,),) = mesh.find([turned], any_way=True)
    np.testing.assert_allclose(found[:, :2], upright[:, :2] @ turn[:, :2].T + turn[:, 2], atol=2.5)


def test_a_frame_without_a_face_has_none(people: dict[str, np.ndarray]) -> None:
    frame, empty = people["alba"][0], np.full((90, 160, 3), 99, np.uint8)
    assert [len(faces) for faces in FaceMesh(tracking=False).find([empty, frame])] == [0, 1]
    assert FaceMesh(tracking=False).find([]) == []
    mesh = FaceMesh(tracking=True)
    assert [len(mesh(image)) for image in (frame, empty, frame)] == [1, 0, 1]


def test_two_faces_are_found_where_two_are_wanted(people: dict[str, np.ndarray]) -> None:
    frame = np.hstack((people["alba"][0], people["dora"][0]))
    assert len(FaceMesh(tracking=False)(frame)) == 1
    faces = FaceMesh(tracking=False, faces=2)(frame)
    assert sorted(int(face[:, 0].mean() // 128) for face in faces) == [0, 1]
    for expected in (np.array([60, 70]), np.array([190, 70])):
        face = nearest(faces, expected)
        assert face is not None
        assert np.abs(face[:, :2].mean(0) - expected).max() < 30


def test_chains_cover_every_frame_once_and_stay_in_their_shots() -> None:
    segment = np.repeat([0, 1, 2], [150, 1, 70])
    groups = list(chains.groups(segment))
    assert max(map(len, groups)) == chains.SIDE_BY_SIDE
    made = [chain for group in groups for chain in group]
    assert [t for c in made for t in range(c.first, c.end)] == list(range(len(segment)))
    assert all(len(set(segment[c.start : c.end])) == 1 for c in made)
    warm = [c.first - c.start for c in made]
    assert warm == [0, chains.WARM_UP, chains.WARM_UP, 0, 0, chains.WARM_UP]


def test_chains_find_what_following_finds(
    people: dict[str, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = np.stack([cv2.resize(frame, (512, 512)) for frame in people["dora"]])
    monkeypatch.setattr(chains, "LENGTH", 6)
    fresh = [nearest(faces, np.zeros(2)) for faces in FaceMesh(tracking=False).find(frames)]
    fresh[4] = None  # where a chain starts: it detects the face in the next frame
    found: dict[int, np.ndarray | None] = {}
    for group in chains.groups(np.zeros(len(frames), int)):
        found |= chains.follow(frames, fresh, group)
    mesh = FaceMesh(tracking=True)
    for t, frame in enumerate(frames):
        (expected,) = mesh(frame)
        assert np.abs(found[t] - expected)[:, :2].mean() < 0.3, t


def test_modes_are_averaged_where_they_agree() -> None:
    fresh = np.random.default_rng(0).uniform(0, 100, (478, 3))
    right, middle = np.array([1, 0, 0]), fresh[:, :2].mean(0)
    steady = fresh + 2 * right
    points, apart, there = combine(steady, fresh, middle)
    np.testing.assert_allclose(points, fresh + right)
    assert (apart, there) == (pytest.approx(2), True)
    points, apart, there = combine(steady + 60 * right, fresh, middle)
    np.testing.assert_allclose(points, fresh)
    assert (apart, there) == (0, True)
    points, apart, there = combine(None, fresh, middle + 200)
    assert (apart, there) == (0, False)
    assert combine(None, None, middle)[2] is False
