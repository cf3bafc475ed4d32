"""Channels of a mouth, differences from its mean without the light; channels of its sound."""

import numpy as np
import pytest
import torch

from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS
from dubbing.face.mouth.mouth_shape import MOUTH
from dubbing.speech.features import features_by_name
from dubbing.speech.mel_features import MelFeatures
from dubbing.sync.network.channels import (
    DARK,
    MOUTH_CHANNELS,
    SOUND_CHANNELS,
    WIDTH,
    SoundChannels,
    mouth_channels,
    relative,
    running_mean,
)
from dubbing.workshop.training.sync.pixel_augmentation import vary_pixels
from tests.dubbing.conftest import Speaker
from tests.dubbing.sync.made import made_crops

TIMES = (np.arange(100) + 0.5) / 25
RNG = np.random.default_rng(0)
TALKING = made_crops(RNG.uniform(2, 12, 100), RNG.uniform(14, 20, 100))


def test_running_mean_by_a_slow_loop() -> None:
    rows = np.random.default_rng(0).normal(size=(100, 3))
    rows[20:30] = np.nan
    mean = running_mean(rows, TIMES, 0.5)
    for k in range(100):
        near = rows[np.abs(TIMES - TIMES[k]) <= 0.5]
        expected = np.nanmean(near, 0)
        assert np.allclose(mean[k], expected, atol=1e-5)


def test_light_and_skin_fall_out() -> None:
    plain = relative(TALKING, TIMES)
    # Black stays black in the dark, so the offset is scaled along.
    dim = 0.5 * (TALKING.astype(np.float32) + DARK) - DARK
    shaded = relative(dim * 1.0, TIMES)
    assert np.abs(plain).max() > 0.5
    assert np.allclose(plain, shaded, atol=1e-3)
    still = relative(np.repeat(TALKING[:1], 100, 0), TIMES)
    assert np.abs(still).max() < 1e-3


def test_a_look_has_everything_and_gaps_where_no_face_is() -> None:
    shapes = np.random.default_rng(0).normal(size=(100, len(MOUTH), 2)).astype(np.float32)
    shapes[40:50] = np.nan
    crops = TALKING.copy()
    crops[40:50] = 0
    seen = mouth_channels(shapes, crops, TIMES)
    assert seen.shape == (100, 2 * len(MOUTH) + ROWS * COLUMNS)
    assert np.isnan(seen[40:50]).all()
    assert np.isfinite(np.delete(seen, np.s_[40:50], 0)).all()
    # The empty crops are no part of the mean.
    there = np.delete(np.arange(100), np.s_[40:50])
    assert np.array_equal(
        seen[there, MOUTH_CHANNELS["pixels"]], relative(crops[there], TIMES[there])
    )
    places = [k for part in MOUTH_CHANNELS.values() for k in range(part.start, part.stop)]
    assert places == list(range(seen.shape[1]))


def test_variations_of_a_still_mouth_show_little_motion() -> None:
    flat = TALKING.reshape(100, -1).astype(np.float32)
    mean = flat.mean(0)
    moving = flat[:60].reshape(4, 3, 5, -1)
    still = np.broadcast_to(mean, moving.shape).copy()
    means = np.repeat(mean[None], 4, 0)
    sizes = []
    for mouths in (moving, still):
        varied = vary_pixels(mouths, means, np.random.default_rng(1))
        assert varied.shape == (12, 5, ROWS * COLUMNS)
        assert torch.isfinite(varied).all()
        sizes.append(float(varied.abs().mean()))
    assert sizes[1] < 0.5 * sizes[0]


@pytest.mark.medium
def test_both_kinds_of_channels_stand_where_they_belong(speaker: Speaker) -> None:
    channels = SoundChannels().extract(speaker.sound)
    assert channels.shape == (200, WIDTH)
    assert np.array_equal(channels[:, SOUND_CHANNELS["mel"]], MelFeatures().extract(speaker.sound))
    rnn = features_by_name("rnn").extract(speaker.sound)
    assert np.array_equal(channels[:, SOUND_CHANNELS["rnn"]], rnn)
