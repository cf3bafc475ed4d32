"""Networks that find persons: one a thread that looks, and none stays behind."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from types import SimpleNamespace

import numpy as np
import pytest

from dubbing.preparation.matting import person_masks


def test_as_many_networks_as_threads_look_at_once_and_all_are_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    both_look = Barrier(2)
    begun: list[int] = []
    closed: list[int] = []

    class Network:
        def __init__(self, make: object) -> None:
            begun.append(id(self))

        def process(self, image: np.ndarray) -> SimpleNamespace:
            if image.any():
                both_look.wait(10)
            return SimpleNamespace(segmentation_mask=np.ones(image.shape[:2], np.float32))

        def close(self) -> None:
            closed.append(id(self))

    monkeypatch.setattr(person_masks, "Solution", Network)
    dark, light = np.zeros((8, 8, 3), np.uint8), np.full((8, 8, 3), 9, np.uint8)
    with person_masks.PersonMasks() as masks, ThreadPoolExecutor(2) as pool:
        assert masks.mask(dark).shape == (8, 8)
        for found in pool.map(masks.mask, [light, light]):
            assert found.shape == (8, 8)
        assert masks.mask(dark).min() == 1
        assert len(begun) == 2
        assert not closed
    assert sorted(closed) == sorted(begun)
