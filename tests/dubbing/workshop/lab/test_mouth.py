"""Mouths of made meshes: pose and size fall out, and every figure says what was made."""

from __future__ import annotations

import numpy as np
import pytest

from dubbing.workshop.lab.mouth import MouthSeries, texture, unit_of
from tests.dubbing.sync.meshes import canonical, talk, turned

pytestmark = pytest.mark.medium


RATE = 25.0
SIZE = 512
PLAIN = np.zeros((SIZE, SIZE, 3), np.uint8)
UNIT = 100.0  # px of an eye distance


def series(found: np.ndarray, truth: np.ndarray, first: int = 0) -> MouthSeries:
    """The mouths of two talks (T, 478, 3), in px."""
    mouths = MouthSeries(canonical(), RATE)
    for k, (a, b) in enumerate(zip(found, truth, strict=True), first):
        mouths.add(k, PLAIN, PLAIN, a, b)
    return mouths


def seen(opening: np.ndarray, width: np.ndarray | float = 0.5, yaw: float = 0.0) -> np.ndarray:
    return turned(talk(opening, width), yaw, UNIT, (256.0, 200.0))


def spoken() -> np.ndarray:
    """A second and a half of openings, some of them closed."""
    return np.clip(0.12 * np.sin(np.arange(40) * 0.7) + 0.05, 0, None)


def test_the_same_mouth_in_another_pose_and_size_is_the_same() -> None:
    gap = spoken()
    far = turned(talk(gap), 0.4, 0.6 * UNIT, (200.0, 230.0))
    figures = series(far, seen(gap)).figures()
    assert figures["lmd"] == pytest.approx(0, abs=1e-3)
    assert figures["lip_rms"] == pytest.approx(0, abs=1e-3)
    assert figures["opening_r"] == pytest.approx(1)
    assert figures["opening_ratio"] == pytest.approx(1)
    assert figures["closure_f1"] == figures["closure_f1_near"] == figures["closure_mcc"] == 1
    assert figures["lag_ms"] == pytest.approx(0, abs=1)
    assert figures["missed"] == 0


def test_openings_and_widths_are_in_eye_distances() -> None:
    mouths = MouthSeries(canonical(), RATE)
    row = mouths.add(3, PLAIN, PLAIN, seen(np.array([0.2]))[0], seen(np.array([0.1]), 0.6)[0])
    assert row.width == pytest.approx(0.5)
    assert row.source_width == pytest.approx(0.6)
    # The mean of three pairs of points, of which two are not in the middle.
    assert row.opening == pytest.approx(2 * row.source_opening)
    assert 0.15 < row.opening <= 0.2


def test_a_mouth_that_opens_half_as_far_and_a_frame_late() -> None:
    gap = spoken()
    late = 0.5 * np.concatenate([gap[:1], gap[:-1]])
    figures = series(seen(late), seen(gap)).figures()
    assert figures["opening_r"] < 0.9
    assert figures["opening_ratio"] == pytest.approx(0.5, abs=0.01)
    assert figures["lag_ms"] == pytest.approx(40, abs=4)
    assert figures["closure_f1"] < figures["closure_f1_near"]


def test_a_mouth_that_never_opens_gets_nothing_for_its_closures() -> None:
    gap = spoken()
    figures = series(seen(np.zeros(40)), seen(gap)).figures()
    assert figures["closure_f1"] > 0.4
    assert figures["closure_mcc"] == 0


def test_distances_are_in_px_at_512_of_the_source() -> None:
    moved = seen(np.full(4, 0.1))
    truth = moved.copy()
    lips = np.arange(478)[np.any(talk(np.array([0.0])) != talk(np.array([0.3])), axis=(0, 2))]
    corner = [61, 78, 291, 308]
    every = np.union1d(lips, corner)
    moved[:, every, 0] += 3
    moved[:, every, 1] += 4
    for size, expected in ((512, 5.0), (256, 10.0)):
        mouths = MouthSeries(canonical(), RATE)
        plain = np.zeros((size, size, 3), np.uint8)
        for k in range(4):
            mouths.add(k, plain, plain, moved[k], truth[k])
        figures = mouths.figures()
        assert figures["lmd"] == pytest.approx(expected, rel=1e-3)
        assert figures["lip_rms"] == pytest.approx(expected, rel=1e-3)
        assert figures["lip_rms_still"] == pytest.approx(0, abs=1e-3)


def test_a_mouth_that_stays_at_its_mean_is_as_far_off_as_a_still_one() -> None:
    truth = seen(spoken())
    still = np.repeat(truth.mean(0)[None], len(truth), 0)
    figures = series(still, truth).figures()
    assert figures["lip_rms"] == pytest.approx(figures["lip_rms_still"], rel=1e-3)
    assert "opening_r" not in figures
    assert figures["opening_ratio"] == pytest.approx(0, abs=1e-6)


def test_a_frame_without_a_face_is_in_no_figure_but_counted() -> None:
    gap = spoken()
    mouths = MouthSeries(canonical(), RATE)
    for k, mesh in enumerate(seen(gap)):
        mouths.add(k, PLAIN, PLAIN, None if k == 7 else mesh, None if k == 9 else mesh)
    assert mouths.figures()["missed"] == 1
    opening = mouths.series("opening")
    assert np.flatnonzero(np.isnan(opening)).tolist() == [7, 9]
    assert MouthSeries(canonical(), RATE).figures() == {}


def test_frames_of_two_parts_are_no_neighbours() -> None:
    mouths = MouthSeries(canonical(), RATE)
    for k, gap in ((20, 0.0), (21, 0.1), (3, 0.1), (4, 0.0)):  # the end before the beginning
        mesh = seen(np.array([gap]))[0]
        mouths.add(k, PLAIN, PLAIN, mesh, mesh)
    opening = mouths.series("opening")
    assert len(opening) == 19
    assert np.flatnonzero(np.isfinite(opening)).tolist() == [0, 1, 17, 18]
    assert opening[1] == pytest.approx(opening[17])


def test_texture_is_that_of_the_box_round_the_own_lips() -> None:
    mesh = seen(np.array([0.1]))[0]
    striped = PLAIN.copy()
    striped[:, ::2] = 200
    here = PLAIN.copy()
    low, high = 200 + 40, 200 + 120  # rows of the mouth: .7 eye distances below the eyes
    here[low:high] = striped[low:high]
    assert texture(here, mesh) == pytest.approx(texture(striped, mesh))
    elsewhere = striped.copy()
    elsewhere[low:high] = 0
    assert texture(elsewhere, mesh) == 0
    mouths = MouthSeries(canonical(), RATE)
    half = (striped // 2).astype(np.uint8)
    mouths.add(0, half, striped, mesh, mesh)
    assert mouths.figures()["texture_ratio"] == pytest.approx(0.25)


def test_a_face_out_of_the_picture_has_no_texture() -> None:
    away = seen(np.array([0.1]))[0] + np.array([2000.0, 0, 0])
    assert np.isnan(texture(PLAIN, away))


def test_an_eye_distance_is_as_many_px_as_the_head_is_large() -> None:
    assert unit_of(seen(np.array([0.1]), yaw=0.3)[0], canonical()) == pytest.approx(UNIT)
