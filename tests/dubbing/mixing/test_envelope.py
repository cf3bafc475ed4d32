"""Fades of 5 ms at both ends of a span, and nothing outside of it, whatever the block."""

from __future__ import annotations

import numpy as np
import pytest

from dubbing.mixing.mix import envelope
from dubbing.mixing.voices import FADE

pytestmark = pytest.mark.medium


SPAN = (1000, 3000)


def test_both_ends_fade_alike() -> None:
    found = envelope([SPAN], 0, 4000)
    ramp = np.arange(FADE + 1, dtype=np.float32) / FADE
    np.testing.assert_allclose(found[1000 : 1000 + FADE + 1], ramp)
    np.testing.assert_allclose(found[2999 : 2999 - FADE - 1 : -1], ramp)
    assert (found[1000 + FADE : 3000 - FADE] == 1).all()
    assert not found[:1000].any()
    assert not found[3000:].any()


@pytest.mark.parametrize("first", [0, 900, 1001, 2999, 3000, 3500])
def test_a_block_is_that_part_of_the_whole(first: int) -> None:
    spans = [SPAN, (2900, 3600)]  # one begins before the other has ended
    np.testing.assert_array_equal(
        envelope(spans, first, 700), envelope(spans, 0, 5000)[first : first + 700]
    )
