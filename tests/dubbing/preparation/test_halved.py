"""A prepared clip at half its size."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dubbing.preparation.halved import HalvedClip
from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking.cropping import to_crop
from tests import clips, fakes


@pytest.fixture
def clip(tmp_path: Path) -> PreparedClip:
    """A clip whose window begins between pixels of the film at half size."""
    film = clips.write_clip(tmp_path / "film.mp4", 6)
    made = fakes.write_prepared(film, tmp_path, window=(9, 5, 32))
    rng = np.random.default_rng(1)
    points = rng.uniform(4, 28, (6, 478, 2))
    return replace(made, landmarks=points, noise=np.tile([4.0, 4.0, 4.0, 0.5, 0.3], (6, 1)))


def test_places_of_the_film_stay(clip: PreparedClip) -> None:
    half = HalvedClip.of(clip)
    assert (half.size, half.source_size) == (16, (32, 24))
    assert half.focal == pytest.approx(clip.focal / 2)
    # The same place of the film, at half its size: whole numbers are middles of pixels.
    places = (clip.landmarks[2] + 0.5) * (clip.crop[2, 2] / clip.size) + clip.crop[2, :2] - 0.5
    expected = to_crop((places + 0.5) / 2 - 0.5, half.crop[2], half.size, half.source_size)
    np.testing.assert_allclose(half.landmarks[2], expected, atol=1e-9)
    # So does the camera: it sees landmarks in the same directions.
    before, after = ((one.landmarks[2] - one.centre[2]) / one.focal for one in (clip, half))
    np.testing.assert_allclose(after, before, atol=1e-9)


def test_pictures_lie_where_the_film_does(clip: PreparedClip) -> None:
    half = HalvedClip.of(clip)
    whole, small = next(clip.film_frames(3, 1)), next(half.film_frames(3, 1))
    assert small.whole.shape == (24, 32, 3)
    assert small.image.shape == small.background.shape == (16, 16, 3)
    np.testing.assert_array_equal(small.landmarks, half.landmarks[3])
    # The middle of the head, through the film's pixels.
    middles = [np.argwhere(matte > 127).mean(0)[::-1] for matte in (whole.matte, small.matte)]
    np.testing.assert_allclose(middles[1], middles[0] * half.scale[3] + half.shift[3], atol=0.3)
    # Outside of the head the background is the film.
    np.testing.assert_array_equal(small.background[:2], small.image[:2])
    np.testing.assert_array_equal(small.noise[:3], whole.noise[:3] / 2)
    # What is pasted is pasted where it was cut.
    out, mask = half.paste(small.whole, 3, 255 - small.image, np.full((16, 16), 255, np.uint8))
    np.testing.assert_array_equal(out[mask > 0], 255 - small.whole[mask > 0])
