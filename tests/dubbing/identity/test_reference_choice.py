"""Which frames become references."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dfrf.data.dataset import EYES, HEAD, HeadDataset
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.heads import fine_tuning as finetuning
from dubbing.identity.reference_choice import choose_references, eye_sharpness, medoids, turns_far
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


def test_a_side_that_no_sharp_frame_shows_is_shown_by_a_soft_one() -> None:
    count = 60
    someone = person(frames=count)
    grain = torch.rand(count, 48, 48, 1, generator=torch.Generator().manual_seed(0))
    size = torch.full((count,), 40.0)
    size[:40] = 120
    images = (90 + size[:, None, None, None] * grain).expand(-1, -1, -1, 3).to(torch.uint8)
    landmarks = np.zeros((count, 478, 2))
    landmarks[:, OUTER_LIP, 0] = np.linspace(220, 280, len(OUTER_LIP))

    def chosen(aside: float) -> list[int]:
        """The last 20 frames, soft ones, are turned so many degrees further than the others."""
        angle = torch.deg2rad(torch.linspace(0, 1, count))
        angle[40:] += np.radians(aside)
        c2w = someone.c2w.clone()
        c2w[:, :, 2] = torch.stack([angle.sin(), torch.zeros(count), angle.cos()], -1)
        turned = replace(someone, c2w=c2w, images=images)
        return choose_references(turned, landmarks, 2).tolist()

    assert max(chosen(aside=4)) < 40
    assert sorted(k >= 40 for k in chosen(aside=8)) == [False, True]


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


def turned(degrees: float, nods: float = 0.0) -> HeadDataset:
    """A person who looks so far to one side and the other, and nods so far, in turn."""
    someone = person(frames=8)
    across = torch.deg2rad(torch.tensor([degrees, -degrees, 0, 0] * 2))
    up = torch.deg2rad(torch.tensor([0, 0, nods, -nods] * 2))
    seen_from = 7 * torch.stack([across.sin(), up.sin(), across.cos() * up.cos()], -1)
    c2w = torch.cat([someone.c2w[:, :, :3], seen_from[..., None]], -1)
    return replace(someone, c2w=c2w)


def test_a_head_turns_far_by_the_root_mean_square_of_its_turns() -> None:
    # Half of the frames are turned, so the whole turns by 1 / sqrt 2 of that.
    assert not turns_far(turned(5.5))
    assert turns_far(turned(5.9))
    assert not turns_far(turned(3.9, nods=3.9))
    assert turns_far(turned(4.1, nods=4.1))
    still = turned(3.9)
    aside = torch.tensor([[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]])
    assert not turns_far(replace(still, c2w=aside @ still.c2w))  # filmed from one side


@pytest.mark.parametrize(
    ("degrees", "references", "pool", "wanted"),
    [(2, 5, 12, 5), (10, 5, 12, 12), (10, 4, 4, 4), (10, 0, 0, None)],
)
def test_only_a_head_that_turns_far_has_more_references_than_a_frame_looks_at(
    degrees: float, references: int, pool: int, wanted: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        finetuning, "choose_references", lambda person, landmarks, count: torch.arange(count)
    )
    method: Any = SimpleNamespace(references=references, reference_pool_size=pool)
    chosen = finetuning.reference_frames(turned(degrees), np.zeros((8, 478, 2)), method)
    assert (None if chosen is None else len(chosen)) == wanted
