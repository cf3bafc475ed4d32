"""Lengths are given for a crop of 512 px, and grow with it."""

from __future__ import annotations

import numpy as np
import pytest

from dubbing.compositing.composite import FEATHER, composite


@pytest.mark.parametrize("size", [512, 1024])
def test_the_seam_is_as_wide_a_share_of_the_crop(size: int) -> None:
    restored = np.zeros((size, size), bool)
    restored[:, size // 4 :] = True
    background, share = np.zeros((size, size, 3), np.uint8), np.full((size, size), 255, np.uint8)
    _, mask = composite(background, restored, np.zeros((size, size, 4), np.uint8), share)
    rising = int(((mask[0] > 0) & (mask[0] < 255)).sum())
    assert abs(rising - FEATHER * size / 512) <= 1
