"""Lengths are given for a crop of 512 px, and grow with it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dubbing.compositing.composite import FEATHER, composite
from dubbing.compositing.neck import Neck, with_neck
from dubbing.face.face_contour import face_contour
from tests import fakes
from tests.dubbing.compositing.test_neck import S, disc, scene


@pytest.mark.parametrize("size", [512, 1024])
def test_the_seam_is_as_wide_a_share_of_the_crop(size: int) -> None:
    restored = np.zeros((size, size), bool)
    restored[:, size // 4 :] = True
    background, share = np.zeros((size, size, 3), np.uint8), np.full((size, size), 255, np.uint8)
    _, mask = composite(background, restored, np.zeros((size, size, 4), np.uint8), share)
    rising = int(((mask[0] > 0) & (mask[0] < 255)).sum())
    assert abs(rising - FEATHER * size / 512) <= 1


def test_a_neck_is_stretched_alike_in_a_crop_of_twice_the_size() -> None:
    image, background, matte, contour = scene()
    made, where = with_neck(image, background, Neck.of(image, matte, contour), disc(90))

    def twice(picture: np.ndarray) -> np.ndarray:
        return cv2.resize(picture, (2 * S, 2 * S), interpolation=cv2.INTER_LINEAR)

    there = face_contour(2 * fakes.face(S), 2 * S)
    neck = Neck.of(twice(image), twice(matte), there)
    large, where_there = with_neck(twice(image), twice(background), neck, twice(disc(90)))
    # As far as a picture of half the size can tell.
    large, where_there = large[::2, ::2].astype(int), where_there[::2, ::2]
    assert (where != where_there).sum() < 0.02 * where.sum()
    assert np.abs(large - made)[where].mean() < 2
