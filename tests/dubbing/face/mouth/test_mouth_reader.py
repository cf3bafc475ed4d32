"""Openings that are read off pictures of mouths."""

import cv2
import numpy as np
import pytest

from dubbing.face.mouth.mouth_reader import MouthReader, mouth_picture
from dubbing.workshop.true_dubs.measure import openings

PLACE = np.array([[50.0, 60.0], [18.0, 9.0]])


def face(opening: float, rng: np.random.Generator) -> np.ndarray:
    """A face in which a dark mouth of so many px is open, with noise and light of its own."""
    image = np.full((100, 100, 3), (200, 150, 130), np.uint8)
    cv2.ellipse(image, (50, 60), (18, 4), 0, 0, 360, (170, 90, 90), -1)
    half = int(16 * opening)
    cv2.ellipse(image, (800, 960), (14 * 16, half), 0, 0, 360, (40, 20, 20), -1, shift=4)
    light = rng.uniform(0.6, 1.2)
    return np.clip(image * light + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def reader() -> MouthReader:
    rng = np.random.default_rng(0)
    known = rng.uniform(0, 8, 120)
    pictures = np.stack([mouth_picture(face(x, rng), PLACE) for x in known])
    return MouthReader(pictures, known)


def test_openings_are_read_off_pictures_in_other_light(reader: MouthReader) -> None:
    rng = np.random.default_rng(1)
    wanted = rng.uniform(0, 8, 60)
    read = reader.read(np.stack([mouth_picture(face(x, rng), PLACE) for x in wanted]))
    assert np.corrcoef(read, wanted)[0, 1] > 0.95
    assert np.abs(read - wanted).mean() < 0.8


def test_what_is_beside_the_mouth_does_not_count(reader: MouthReader) -> None:
    rng = np.random.default_rng(2)
    image = face(4.0, rng)
    beside = image.copy()
    beside[:30] = 0
    first, second = reader.read(np.stack([mouth_picture(x, PLACE) for x in (image, beside)]))
    assert abs(first - second) < 0.2


def test_the_dub_is_compared_with_the_truth() -> None:
    truth = np.sin(np.arange(50))
    found = openings(0.5 * truth, truth, truth)
    assert found["opening_r"] == pytest.approx(1)
    assert found["opening_ratio"] == pytest.approx(0.5)
    assert openings(truth, np.cos(np.arange(50)), truth) == {}
