"""Masks of the synthetic speakers."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from dubbing.preparation.matting.masks import person_masks

pytestmark = pytest.mark.medium

# Share of the last frame that is a person; MediaPipe 0.10.21 gives the same.
SHARES = {"alba": 0.4216, "chidi": 0.4048, "dora": 0.4573}


def test_masks_cover_the_person(people: dict[str, np.ndarray]) -> None:
    masks = person_masks([people[name][-1] for name in SHARES])
    for mask, share in zip(masks, SHARES.values(), strict=True):
        assert mask.shape == people["alba"].shape[1:3]
        assert mask.mean() == pytest.approx(share, abs=2e-3)
        assert mask[64, 64] > 0.9
        assert mask[5, 5] < 0.1


def test_threads_share_a_network(people: dict[str, np.ndarray]) -> None:
    frames, count = people["alba"][:6], torch.get_num_threads()
    with ThreadPoolExecutor(2) as pool:
        alone = list(pool.map(lambda frame: person_masks([frame])[0], frames))
    np.testing.assert_allclose(person_masks(frames), alone, atol=1e-4)
    assert torch.get_num_threads() == count
