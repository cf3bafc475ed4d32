"""Faces that look alike and not, and mouths that something covers: on the synthetic speaker."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dubbing.face.finding.landmarks import FaceMesh
from dubbing.face.mesh_points import LEFT_EYE_AND_BROW, RIGHT_EYE_AND_BROW
from dubbing.preparation.covering.occlusion import (
    AROUND,
    SHARE,
    covered_step,
    sight_of,
    unusual_share,
)
from dubbing.preparation.tracking.likeness import FARTHEST, apart, looks
from dubbing.preparation.tracking.procrustes import head_frame, mean_shape

pytestmark = pytest.mark.medium


HIDDEN = np.arange(8, 12)
MOUTH = (61, 291, 0, 17)
FRONT = (0.0, 0, -1)


def meshes(frames: np.ndarray) -> np.ndarray:
    mesh = FaceMesh(tracking=False)
    return np.stack([mesh(frame)[0] for frame in frames])


def test_parts_of_one_person_are_nearer_than_other_people(people: dict[str, np.ndarray]) -> None:
    seen = {}
    for name, frames in people.items():
        some = frames[::3]
        darker = (some[4:] * np.array([0.92, 0.88, 0.84])).astype(np.uint8)
        for part, pictures in (("first", some[:3]), ("last", darker)):
            found = zip(pictures, meshes(pictures), strict=True)
            seen[name, part] = np.stack([looks(*pair) for pair in found])
    for name in people:
        apart_from = {other: apart(seen[name, "first"], seen[other, "last"]) for other in people}
        assert apart_from.pop(name) < FARTHEST < min(apart_from.values())


@pytest.mark.parametrize("kind", ["microphone", "scarf", "nothing"])
def test_what_lies_over_a_mouth_is_found(people: dict[str, np.ndarray], kind: str) -> None:
    frames = people["alba"].copy()
    clean = meshes(frames)
    if kind != "nothing":
        colour = {"microphone": (30, 30, 34), "scarf": (40, 90, 200)}[kind]
        for t in HIDDEN:
            middle = clean[t, list(MOUTH), :2].mean(0) + 2
            wide = float(np.ptp(clean[t, :, 0])) * np.array([0.45, 0.6])
            place = (tuple(map(float, middle)), tuple(map(float, wide)), 20.0)
            cv2.ellipse(frames[t], place, tuple(map(float, colour)), -1)
    points = meshes(frames)
    shape = head_frame(mean_shape(points, tuple(range(468))))
    valid, one = np.ones(len(frames), bool), np.zeros(len(frames), int)
    views = np.tile(FRONT, (len(frames), 1))
    found = covered_step(frames, points, valid, one, shape, views, lambda share: None)["covered"]
    expected = np.zeros(len(frames), bool)
    if kind != "nothing":
        expected[HIDDEN[0] - AROUND : HIDDEN[-1] + AROUND + 1] = True
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("covered", [True, False])
def test_what_a_turned_head_hides_of_itself_covers_nothing(
    people: dict[str, np.ndarray], covered: bool
) -> None:
    shape = head_frame(mean_shape(meshes(people["alba"][:3]), tuple(range(468))))
    yaw = np.deg2rad([0.0] * 40 + [60.0] * 3)
    views = np.stack([np.sin(yaw), 0 * yaw, -np.cos(yaw)], 1)
    colours = np.random.default_rng(0).normal((190, 140, 120), 3, (43, len(shape), 3))
    colours[:, [*LEFT_EYE_AND_BROW, *RIGHT_EYE_AND_BROW]] *= 0.4
    colours[40:, shape[:, 0] < -0.2] = (60, 90, 200)  # the far side: the wall behind it
    if covered:
        colours[41, shape[:, 1] > 0] = (40, 40, 40)
    sight = sight_of(colours, np.zeros((43, 3)), shape, views, views)
    assert sight.turn[-1] == pytest.approx(yaw[-1])
    seen = ~np.isnan(sight.colours[..., 0])
    assert seen[:40].all()
    assert 0.3 < seen[-1].mean() < 0.7
    share, _ = unusual_share(sight, sight, shape)
    assert (share > SHARE).nonzero()[0].tolist() == ([41] if covered else [])
