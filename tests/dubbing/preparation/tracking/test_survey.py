"""Which face is followed where a shot shows several."""

from __future__ import annotations

import numpy as np
import pytest

from dubbing.preparation.tracking.survey import Place, Sighting, follow

FRAMES, CUT = 40, 20
SEGMENT = np.repeat([0, 1], [CUT, FRAMES - CUT])
LEFT, RIGHT = 100.0, 300.0  # px; the face on the right is larger


def face(frame: int, column: float, side: float) -> Sighting:
    half = side / 2
    return Sighting(frame, np.array([column - half, 100 - half, column + half, 100 + half]))


def sightings() -> list[list[Sighting]]:
    """Both in the first shot, drifting; the one on the right alone in the second."""
    first = [[face(t, LEFT + t, 40), face(t, RIGHT - t, 60)] for t in range(0, CUT, 5)]
    return first + [[face(t, RIGHT, 60)] for t in range(CUT, FRAMES, 5)]


def test_the_largest_face_is_followed_in_every_shot() -> None:
    box, found, followed = follow(sightings(), SEGMENT)
    assert followed.all()
    assert found.sum() == 8
    np.testing.assert_allclose(box[:15, [0, 2]].mean(1), RIGHT - np.arange(15))


def test_the_face_at_a_point_is_followed_in_its_shot_alone() -> None:
    box, _, followed = follow(sightings(), SEGMENT, [Place(12, np.array([115.0, 90.0]))])
    np.testing.assert_array_equal(followed, SEGMENT == 0)
    np.testing.assert_allclose(box[:15, [0, 2]].mean(1), LEFT + np.arange(15))
    places = [Place(0, np.array([105.0, 95.0])), Place(39, np.array([290.0, 100.0]))]
    box, _, followed = follow(sightings(), SEGMENT, places)
    assert followed.all()
    np.testing.assert_allclose(box[[0, 39]][:, [0, 2]].mean(1), [LEFT, RIGHT])


@pytest.mark.parametrize("place", [Place(12, np.array([200.0, 100.0])), Place(30, np.zeros(2))])
def test_a_point_beside_every_face_is_said(place: Place) -> None:
    with pytest.raises(LookupError, match=f"of frame {place.frame}"):
        follow(sightings(), SEGMENT, [place])
