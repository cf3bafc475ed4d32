"""How far lips leave the closed mouth, so that an opening is seen as wide as was asked for."""

import numpy as np
import pytest

from dubbing.identity import lip_scale
from dubbing.identity.lip_scale import LipScale

CLOSED, SPOKEN = -1.0, np.array([2.0, 0.5, -0.8, -1.0], np.float32)


def seen(measures: np.ndarray, parting: float) -> np.ndarray:
    """The gap of lips that touch below `parting`."""
    return np.maximum(measures - parting * CLOSED, 0)


@pytest.mark.parametrize("parting", [1.0, 0.6])
@pytest.mark.parametrize("strength", [0.0, 0.25, 0.5, 0.9, 1.0, 1.5])
def test_the_gap_is_as_wide_as_was_asked_for(parting: float, strength: float) -> None:
    scale = LipScale(np.zeros(7), np.ones(7), parting)
    shares = scale.shares(np.full(4, strength, np.float32), SPOKEN, CLOSED)
    lips = CLOSED + shares * (SPOKEN - CLOSED)
    wide = slice(0, 2)
    if strength <= 1:
        wanted = strength * seen(SPOKEN, parting)
        np.testing.assert_allclose(seen(lips, parting)[wide], wanted[wide], atol=1e-6)
    else:
        np.testing.assert_allclose(shares, strength)
    assert (shares[:3] == strength).all() or 0 < strength < 1
    assert np.isfinite(shares).all()


def test_a_person_whose_lips_touch_often_parts_them_late() -> None:
    opening = np.linspace(0.04, 0.12, 100)
    never, often = (lip_scale._parting(opening, opening < most) for most in (0.0, 0.08))
    assert never == 1
    assert 0 < often < 0.4
    assert lip_scale._parting(np.full(9, 0.1), np.ones(9)) == 1  # lips that never move
