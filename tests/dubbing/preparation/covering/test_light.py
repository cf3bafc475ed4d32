"""The light of frames, from colours that are known."""

from dataclasses import replace

import numpy as np
import pytest

from dubbing.face.mesh_points import LEFT_EYE_AND_BROW
from dubbing.preparation.covering.light import Sight, coarse_gain, light_of, noticed, shade

FRAMES, POINTS = 6, 478
STILL = np.arange(100, 200)
RNG = np.random.default_rng(0)
USUAL = RNG.uniform(90, 220, (POINTS, 3))
USUAL[list(LEFT_EYE_AND_BROW)] = RNG.uniform(20, 90, (len(LEFT_EYE_AND_BROW), 3))


def seen(
    gain: float | list[float], offset: float = 0.0, turn: float = 0.0, dark: float = 255.0
) -> Sight:
    """A face in that light, with noise, and a tenth of the points covered."""
    lit = np.multiply(USUAL, gain) + offset + RNG.normal(0, 2, (FRAMES, POINTS, 3))
    lit[:, 100:110] = 10
    return Sight(lit, np.full(FRAMES, turn), np.full((FRAMES, 3), dark))


@pytest.mark.parametrize("gain", [0.1, 0.4, 1.0, 1.2, [1.1, 1.0, 0.7]])
def test_a_lamp_or_a_fade_is_a_gain(gain: float | list[float]) -> None:
    light = light_of(seen(gain), USUAL, STILL)
    assert np.abs(light.gain - gain).max() < 0.03
    assert not light.offset.any()
    lit = light.lit(USUAL)
    np.testing.assert_allclose(light.unlit(lit), np.tile(USUAL, (FRAMES, 1, 1)))


@pytest.mark.parametrize("white", [0.25, 0.5, 0.8])
def test_a_fade_to_white_is_haze(white: float) -> None:
    light = light_of(seen(1 - white, 255 * white), USUAL, STILL)
    assert np.abs(light.offset - 255 * white).max() < 6
    assert np.abs(light.gain - (1 - white)).max() < 0.04


def test_a_little_haze_is_a_head_that_turns() -> None:
    assert not light_of(seen(0.95, 12.0), USUAL, STILL).offset.any()


def test_a_head_that_is_turned_far_shows_no_haze() -> None:
    light = light_of(seen(0.5, 100.0, turn=0.5), USUAL, STILL)
    assert not light.offset.any()


def test_a_shadow_on_a_part_of_a_face_is_no_haze() -> None:
    """Half of the points in it look like more contrast, which takes light away."""
    half = seen(1.0)
    half.colours[:, STILL[::2]] *= 0.4
    assert (light_of(half, USUAL, STILL).offset >= 0).all()


@pytest.mark.parametrize("light", [0.4, 1.6])
def test_a_shadow_or_a_lamp_on_a_part_of_a_face_is_light(light: float) -> None:
    ratio = np.zeros((80, 90, 3))
    ratio[:, 45:] = np.log(light) + np.array([0.04, 0.0, -0.04])  # the sky is blue
    found = shade(ratio, np.ones((80, 90), bool), 4.0)
    beside_edge = np.abs(np.arange(90) - 44.5) < 8
    assert np.abs(found - ratio)[:, ~beside_edge].max() < 0.25 * abs(np.log(light))


def test_a_thing_of_another_colour_is_no_light() -> None:
    ratio = np.zeros((80, 90, 3))
    ratio[30:60, 30:60] = np.log(np.array([30, 32, 35]) / (200, 150, 130))
    found = shade(ratio, np.ones((80, 90), bool), 4.0)
    assert np.abs(found[34:56, 34:56]).max() < 0.3


def test_haze_leaves_nothing_darker_than_itself() -> None:
    assert not light_of(seen(0.5, 100.0, dark=15.0), USUAL, STILL).offset.any()
    assert np.abs(light_of(seen(0.5, 100.0, dark=100.0), USUAL, STILL).offset - 100).max() < 6


def test_haze_is_grey_where_a_channel_is_dark_all_over_the_frame() -> None:
    """A blue shirt says nothing about the red of the haze before a face."""
    sight = seen(0.5, 100.0)
    dark = np.tile([60.0, 100, 100], (FRAMES, 1))
    offset = light_of(replace(sight, dark=dark), USUAL, STILL).offset
    assert (offset == offset[:, :1]).all()
    assert np.abs(offset - 60).max() < 6


def test_what_a_frame_does_not_see_has_no_light() -> None:
    sight = seen(0.5)
    sight.colours[:, :150] = 250
    blind = replace(sight, colours=np.where(sight.colours == 250, np.nan, sight.colours))
    assert np.abs(light_of(blind, USUAL, STILL).gain - 0.5).max() < 0.03


def test_only_what_one_notices_is_told_from_the_usual_light() -> None:
    gain = np.array([[1.0, 1.05, 0.95], [0.8, 1, 1], [1, 1, 1]])
    offset = np.array([[0.0, 0, 0], [0, 0, 0], [30, 30, 30]])
    found, haze = noticed(gain, offset)
    assert found.tolist() == [[1, 1, 1], [0.8, 1, 1], [1, 1, 1]]
    assert np.array_equal(haze, offset)


def test_frames_without_a_face_are_dark_or_as_usual() -> None:
    usual = np.array([100.0, 100, 100])
    level = np.array([[0.0, 0, 0], [20, 20, 20], [80, 85, 90]])
    assert coarse_gain(level, usual).tolist() == [[0.02] * 3, [0.2] * 3, [1.0] * 3]
