"""A blurred mouth is blurred there only; a frozen one stays the same while the head moves."""

import numpy as np
import pytest

from dubbing.sync.check import check
from dubbing.workshop.training.sync.degradation import Freezer, blurred, check_changed, mouth_mask
from tests.dubbing.conftest import Speaker
from tests.dubbing.sync.meshes import talk, turned

pytestmark = pytest.mark.medium


POINTS = turned(talk(np.array([0.1])), 0, 60, (100, 80))[0]


def test_the_mask_covers_the_mouth_only() -> None:
    mask = mouth_mask(POINTS, (200, 200))
    assert mask.shape == (200, 200)
    assert mask[80 + 42, 100] > 0.9
    assert mask[80, 70] < 0.01, "the eyes"


def test_blur_stays_in_the_mouth() -> None:
    frame = np.random.default_rng(0).integers(0, 255, (200, 200, 3)).astype(np.uint8)
    soft = blurred(frame, POINTS, 0.2)
    assert np.array_equal(soft[:60], frame[:60])
    mouth = (slice(115, 130), slice(90, 110))
    assert soft[mouth].std() < 0.5 * frame[mouth].std()


def test_a_frozen_mouth_follows_the_head() -> None:
    rng = np.random.default_rng(0)
    freeze = Freezer()
    first = rng.integers(0, 255, (200, 200, 3)).astype(np.uint8)
    assert np.array_equal(freeze(first, POINTS), first)
    moved = POINTS + np.array([6, 4, 0])
    later = freeze(np.zeros_like(first), moved)
    difference = later[122 + 4, 95 + 6 : 105 + 6].astype(int) - first[122, 95:105]
    assert np.abs(difference).max() <= 5
    assert later[:60].max() == 0


def test_confidence_falls_and_a_frozen_mouth_fails(speaker: Speaker) -> None:
    whole = check(speaker.clip)
    still = check_changed(speaker.clip, 4.0, Freezer(), whole)
    assert still.verdict == "fail"
    assert whole.confidence is not None
    assert still.confidence is not None
    assert still.confidence < 0.6 * whole.confidence
