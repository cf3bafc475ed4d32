"""Which frames become references."""

from dataclasses import replace

import numpy as np
import torch

from dfrf.data import EYES, HEAD
from dubbing.reference_choice import choose_references, eye_sharpness, medoids
from dubbing.sync.mouth import OUTER_LIP
from tests.dfrf.people import person


def test_references_stand_for_all_poses_and_are_sharp() -> None:
    count = 60
    someone = person(frames=count)  # in a row from the left to the right
    forward = torch.zeros(count, 3)
    forward[:, 0] = torch.linspace(-0.5, 0.5, count)
    c2w = someone.c2w.clone()
    c2w[:, :, 2] = forward
    noise = torch.Generator().manual_seed(0)
    grain = torch.rand(count, 48, 48, 1, generator=noise)
    size = torch.full((count,), 40.0)
    sharp = torch.arange(1, count, 3)
    size[sharp] = 120
    images = (90 + size[:, None, None, None] * grain).expand(-1, -1, -1, 3).to(torch.uint8)
    someone = replace(someone, c2w=c2w, images=images)
    found = eye_sharpness(someone, np.arange(count))
    assert set(np.argsort(found)[-len(sharp) :]) == set(sharp.tolist())
    assert np.array_equal(eye_sharpness(someone, np.array([7, 3])), found[[7, 3]])
    landmarks = np.zeros((count, 478, 2))
    landmarks[:, OUTER_LIP] = np.stack(
        [np.linspace(220, 280, len(OUTER_LIP)), np.full(len(OUTER_LIP), 300.0)], -1
    )
    chosen = sorted(choose_references(someone, landmarks, 3).tolist())
    assert set(chosen) <= set(sharp.tolist())
    # Each in the middle of a third of the row.
    np.testing.assert_allclose(chosen, [9.5, 29.5, 49.5], atol=2)


def test_medoids_stand_for_many_and_are_exchanged_for_better_ones() -> None:
    # Two groups, one between them and a stray.
    places = np.array([0.0, 0.1, 0.2, 0.9, 1.0, 1.1, 0.55, 1.6])
    apart = np.abs(places[:, None] - places)
    assert sorted(medoids(apart, 2)) == [1, 4]
    assert sorted(medoids(apart, 3)) == [1, 4, 7]
    assert len(medoids(apart[:, :1], 2)) == 2  # one to choose from: it is taken twice


def test_frames_whose_eyes_are_not_seen_are_not_sharp() -> None:
    someone = person()
    regions = torch.where(someone.regions == EYES, HEAD, someone.regions).to(torch.uint8)
    assert not eye_sharpness(replace(someone, regions=regions), np.arange(someone.frames)).any()
