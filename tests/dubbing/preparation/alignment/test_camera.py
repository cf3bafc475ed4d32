"""The camera that a clip is taken to be filmed with."""

import numpy as np
import pytest

from dubbing.preparation.alignment.camera import NEAR_LENS, NORMAL_LENS, focal_length


@pytest.mark.parametrize(
    ("side", "source", "size", "wanted"),
    [
        (512, (512, 512), 512, NEAR_LENS * 512),  # a head alone
        (700, (1280, 720), 512, NORMAL_LENS * 1280 * 512 / 700),
        (600, (1080, 1920), 512, NORMAL_LENS * 1920 * 512 / 600),
        (600, (1080, 1920), 256, NORMAL_LENS * 1920 * 256 / 600),
    ],
)
def test_what_a_frame_shows_beside_the_head_was_filmed_from_further_away(
    side: int, source: tuple[int, int], size: int, wanted: float
) -> None:
    window = np.tile([0.0, 0.0, side], (3, 1))
    assert focal_length(window, source, size) == pytest.approx(wanted)
