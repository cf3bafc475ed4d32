"""How far, how fast and when a mouth moves, and how close that comes to another."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from dubbing.face.mouth.mouth_shape import mouth_shape
from dubbing.sync.closeness import WEIGHTS, closeness, number_of
from dubbing.sync.curves import OFFSETS, early_ms
from dubbing.sync.mouth_figures import MouthSeries, mouth_figures, moved, of_mouth, silent_frames
from dubbing.sync.result import Figures
from tests.dubbing.sync.made import made_crops
from tests.dubbing.sync.meshes import canonical, talk

RATE = 25.0
CURVE = np.where(np.array(OFFSETS) == 0, 0.8, 1.0)
VOICE = np.repeat([1.0, 0.0], [150, 50])
ASKED = np.convolve(np.random.default_rng(1).normal(size=200), np.hanning(7), "same")
RESTLESS = np.maximum(0.07 + 0.02 * ASKED, 0)
ASKED[VOICE == 0] = -3
SPOKEN = np.where(VOICE > 0, RESTLESS, 0.005)
SOUND = [VOICE, 60 + 10 * np.random.default_rng(2).normal(size=200), ASKED, -ASKED]


def figures(
    opening: np.ndarray = SPOKEN, blur: float = 0, offset: int = 0, seen: slice = slice(None)
) -> Figures:
    """Of a mouth with an opening (200,), beside what the sound asks for."""
    crops = made_crops(50 * opening, np.full(len(opening), 18.0))
    if blur:
        crops = np.stack([cv2.GaussianBlur(crop, (0, 0), blur) for crop in crops])
    mouth = of_mouth(mouth_shape(talk(opening), canonical()), crops, RATE)
    series = MouthSeries(RATE, *mouth, *SOUND)
    chosen = np.zeros(len(opening), bool)
    chosen[seen] = True
    found = mouth_figures(series, chosen, CURVE, offset)
    assert found is not None
    return found


OWN = figures()


def test_the_original_is_as_close_as_can_be() -> None:
    assert OWN.certainty == pytest.approx(0.2)
    assert OWN.opening > 0.95
    assert OWN.closures > 0.7
    assert OWN.restless == 0
    assert closeness(OWN, OWN, 0.0).number == pytest.approx(1)


@pytest.mark.parametrize(
    ("part", "changed", "most"),
    [
        ("opening", SPOKEN[::-1], 0.3),
        ("closures", np.where(VOICE > 0, np.maximum(SPOKEN, 0.07), 0.005), 0.8),
        ("range", 0.5 * SPOKEN, 0.55),
        ("range", 2 * SPOKEN, 0.55),
        ("speed", 0.5 * SPOKEN, 0.55),
        ("silence", RESTLESS, 0.3),
    ],
)
def test_a_fault_lowers_its_part_and_the_number(
    part: str, changed: np.ndarray, most: float
) -> None:
    near = closeness(figures(changed), OWN, 0.0)
    assert near.parts[part] < most
    assert near.number < 0.95


def test_a_soft_mouth_is_less_close_the_softer_it_is() -> None:
    numbers = [closeness(figures(blur=blur), OWN, 0.0).number for blur in (0, 1.5, 3)]
    assert numbers[0] > numbers[1] + 0.05 > numbers[2] + 0.05


def test_a_mouth_that_follows_the_loudness_is_no_closer_than_one_that_follows_nothing() -> None:
    flapping = replace(OWN, loudness=1.0)
    assert closeness(flapping, OWN, 0.0).parts["loudness"] < 0.3
    assert closeness(flapping, OWN, 0.0).weakest == "loudness"


def test_more_certainty_than_the_films_is_no_fault_and_no_praise() -> None:
    assert closeness(replace(OWN, certainty=0.4), OWN, 0.0).number == pytest.approx(1)
    unsure = replace(OWN, certainty=0.01)
    assert closeness(unsure, unsure, 0.0).number < 0.95, "a film that hides its words excuses none"


def test_early_sound_counts_for_more_than_late_sound() -> None:
    assert closeness(OWN, OWN, 45).parts["timing"] == pytest.approx(0.5)
    assert closeness(OWN, OWN, -125).parts["timing"] == pytest.approx(0.5)


def test_what_was_not_measured_does_not_count() -> None:
    parts = dict.fromkeys(WEIGHTS, 0.8)
    assert number_of(parts) == pytest.approx(0.8)
    del parts["silence"]
    assert number_of(parts) == pytest.approx(0.8)
    assert figures(seen=slice(0, 140)).restless is None, "too little silence to tell"


def test_the_sound_is_moved_to_its_mouth() -> None:
    late = np.roll(SPOKEN, -3)  # the mouth is three frames ahead of its sound
    assert figures(late, seen=slice(0, 140)).opening < 0.6
    # As of a film whose sound comes three frames late.
    assert figures(late, offset=-3).opening > 0.9
    assert moved(np.arange(4.0), 1)[1:].tolist() == [0, 1, 2]
    assert moved(np.arange(4.0), -1)[:3].tolist() == [1, 2, 3]


def test_frames_without_a_face_do_not_count() -> None:
    shapes = mouth_shape(talk(SPOKEN), canonical())
    shapes[50:80] = np.nan
    mouth = of_mouth(shapes, made_crops(50 * SPOKEN, np.full(200, 18.0)), RATE)
    series = MouthSeries(RATE, *mouth, *SOUND)
    chosen = np.ones(200, bool)
    found = mouth_figures(series, chosen, CURVE)
    assert found is not None
    assert found.range == pytest.approx(OWN.range, rel=0.2)
    shapes[:] = np.nan
    mouth = of_mouth(shapes, made_crops(50 * SPOKEN, np.full(200, 18.0)), RATE)
    series = MouthSeries(RATE, *mouth, *SOUND)
    assert mouth_figures(series, chosen, CURVE) is None


def test_silence_has_a_margin() -> None:
    voice = np.zeros(50)
    voice[20:25] = 1
    silent = silent_frames(voice, 25.0)
    assert silent[:12].all()
    assert not silent[12:33].any()
    assert silent[33:].all()


def test_an_offset_between_frames() -> None:
    curve = (np.array(OFFSETS) - 2.25) ** 2
    assert early_ms(curve, 25.0) == pytest.approx(90)
    assert early_ms(curve[::-1], 25.0) == pytest.approx(-90)
