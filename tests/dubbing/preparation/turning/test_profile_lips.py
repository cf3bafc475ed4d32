"""Lips of profiles, read off the picture by what is heard."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from dubbing.face.mesh_points import CHIN, LEFT_EAR, NOSE_BASE, NOSE_TIP, RIGHT_EAR
from dubbing.face.mouth.lip_measures import lip_lengths
from dubbing.face.mouth.mouth_reader import SIDE
from dubbing.preparation.turning import profile_lips
from dubbing.preparation.turning.profile_lips import (
    FEWEST,
    FRONT,
    LipShapes,
    Profiles,
    profile_picture,
    read_lips,
)

FRAMES, LENGTHS = 120, 7
Rng = np.random.Generator


@pytest.fixture
def rng() -> Rng:
    return np.random.default_rng(0)


def spoken(rng: Rng, frames: int = FRAMES) -> np.ndarray:
    """Lips (T, L) of somebody who speaks: mean 0, variance 1."""
    lips = gaussian_filter1d(rng.normal(size=(frames, LENGTHS)), 1.5, axis=0)
    lips[:, 1:3] = lips[:, :1]
    return np.asarray((lips - lips.mean(0)) / lips.std(0))


def pictures_of(rng: Rng, lips: np.ndarray) -> np.ndarray:
    """Pictures (T, D) that change with the opening above all, and slowly with the pose."""
    shapes = rng.normal(size=(LENGTHS, SIDE * SIDE))
    shapes[3:] /= 3
    drift = np.sin(np.arange(len(lips)) / 20)[:, None] * rng.normal(size=SIDE * SIDE)
    return np.asarray(lips @ shapes + drift + rng.normal(0, 0.3, (len(lips), SIDE * SIDE)))


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


def test_what_is_read_is_nearer_to_the_lips_than_what_is_heard(rng: Rng) -> None:
    lips = spoken(rng)
    heard = 0.6 * lips + 0.6 * spoken(rng) + 0.3
    read = read_lips(pictures_of(rng, lips), heard)
    assert read is not None
    assert correlation(heard[:, 0], lips[:, 0]) < 0.75
    assert correlation(read[:, 0], lips[:, 0]) > 0.9
    assert np.allclose(read.mean(0), heard.mean(0))
    assert np.allclose(read.std(0), heard.std(0))


def test_lips_that_do_not_follow_the_sound_are_not_read(rng: Rng) -> None:
    lips = spoken(rng)
    pictures = pictures_of(rng, lips)
    assert sum(read_lips(pictures, spoken(rng)) is not None for _ in range(60)) <= 6
    assert read_lips(pictures, np.zeros((FRAMES, LENGTHS))) is None  # silence
    assert read_lips(pictures[: FEWEST - 1], lips[: FEWEST - 1]) is None


def test_a_face_changes_as_its_lips_do(rng: Rng) -> None:
    shape = rng.normal(size=(478, 3))
    # The lips of frames seen from the front open by a sine, whatever the pose.
    gap = 0.3 + 0.2 * np.sin(np.arange(FRAMES))
    shapes = np.tile(shape, (FRAMES, 1, 1))
    shapes[:, 14, 1] = shape[13, 1] + gap
    turn = Rotation.from_euler("YX", rng.normal(0, 5, (FRAMES, 2)), degrees=True).as_matrix()
    found = LipShapes.of(40 * shapes @ turn.transpose(0, 2, 1) + [50, 60, 0], shape)
    lengths = lip_lengths(shapes[..., :2])
    np.testing.assert_allclose(found.lengths, lengths, atol=1e-6)
    changes = found.changes(lengths[:10])
    moved = (shapes - shapes.mean(0))[:10]
    moved[..., 2] = 0.8 * moved[..., 1]  # a jaw hinges, which the front does not show
    assert np.abs(changes - moved).max() < 0.2 * np.abs(moved).max()
    assert np.isnan(found.changes(np.full((1, LENGTHS), np.nan))).all()


def test_a_profile_that_looks_to_the_left_is_read_as_one_that_looks_to_the_right(rng: Rng) -> None:
    image = cv2.GaussianBlur(rng.integers(0, 255, (100, 101, 3), np.uint8), (0, 0), 3)
    points = np.full((478, 2), (60.0, 60.0))
    points[[NOSE_BASE, CHIN, NOSE_TIP]] = (65, 50), (60, 75), (70, 48)
    points[[LEFT_EAR, RIGHT_EAR]] = 30, 40
    one = profile_picture(image, points)
    other = profile_picture(image[:, ::-1], points * [-1, 1] + [100, 0])
    assert correlation(one, other) > 0.999
    assert correlation(one, profile_picture(image, points * [-1, 1] + [100, 0])) < 0.9


@pytest.fixture
def film(rng: Rng, monkeypatch: pytest.MonkeyPatch) -> tuple[Profiles, np.ndarray, Any]:
    """Profiles whose openings are heard and seen; none have landmarks but the last five."""
    lips = spoken(rng)
    frames, pictures = np.arange(FRAMES), iter(pictures_of(rng, lips)[FRONT:])
    turn = np.where(frames < FRONT, 0.1, np.radians(80))
    turn[-5:] = np.radians(65)
    valid = (frames < FRONT) | (frames >= FRAMES - 5)
    lengths = np.where(valid[:, None], 1 + 0.1 * rng.normal(size=(FRAMES, LENGTHS)), np.nan)
    images, places = np.zeros((FRAMES, 8, 8, 3), np.uint8), np.zeros((FRAMES, 478, 2))
    monkeypatch.setattr(profile_lips, "profile_picture", lambda *_: next(pictures))
    monkeypatch.setattr(profile_lips, "heard_lips", lambda *_: lips + 0.3 * spoken(rng))
    profiles = Profiles(images, places, turn, lengths, frames < FRONT)
    return profiles, lips, lambda rate: type("Info", (), {"audio_rate": rate})


def test_only_lips_that_landmarks_do_not_tell_are_read(film: tuple[Profiles, Any, Any]) -> None:
    profiles, lips, info = film
    read = profiles.lips_step(info(16000), 0, lambda _: None)["lips"]
    told = np.isfinite(read).all(1)
    assert told.tolist() == [FRONT <= t < FRAMES - 5 for t in range(FRAMES)]
    own = profiles.lengths[:FRONT]
    wanted = own.mean(0) + lips * own.std(0)
    assert correlation(read[told, 0], wanted[told, 0]) > 0.9
    assert 0.7 < read[told, 0].std() / wanted[told, 0].std() < 1.3


@pytest.mark.parametrize(("noise", "read"), [(0.3, False), (3.0, True)])
def test_landmarks_of_profiles_count_where_they_say_what_the_picture_says(
    film: tuple[Profiles, np.ndarray, Any], rng: Rng, noise: float, read: bool
) -> None:
    profiles, lips, info = film
    told, lost = 0.1 * (lips + noise * spoken(rng)) + 1, slice(FRONT, FRONT + 9)
    told[lost] = np.nan
    seen = replace(profiles, lengths=told)
    found = np.isfinite(seen.lips_step(info(16000), 0, lambda _: None)["lips"]).all(1)
    assert found[lost].all()
    assert found[lost.stop : -5].all() == read
    assert found.sum() == (FRAMES - FRONT - 5 if read else 9)


def test_without_sound_nothing_is_read(film: tuple[Profiles, Any, Any]) -> None:
    profiles, _, info = film
    assert np.isnan(profiles.lips_step(info(None), 0, lambda _: None)["lips"]).all()
