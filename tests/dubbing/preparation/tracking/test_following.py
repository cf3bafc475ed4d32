"""Which face is followed where a shot shows several."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dubbing.face.mesh_points import RIGID
from dubbing.preparation.tracking.following import (
    Person,
    Place,
    Sighting,
    Track,
    follow,
    strays,
)
from dubbing.preparation.tracking.likeness import COLOUR_SCALE, PARTS
from dubbing.preparation.tracking.survey import other_face

FRAMES, CUT = 40, 20
SEGMENT = np.repeat([0, 1], [CUT, FRAMES - CUT])
LEFT, RIGHT = 100.0, 300.0  # px; the face on the right is larger
SHAPE = np.random.default_rng(0).normal(0, 0.4, 3 * len(RIGID))


def looks(who: int, off: float = 0.0) -> np.ndarray:
    """Faces of one shape whose colours are 5 spreads apart, and off by a little."""
    return np.concatenate([SHAPE, np.tile(COLOUR_SCALE * (5 * who + off), len(PARTS))])


def face(frame: int, column: float, side: float, who: int, off: float = 0.0) -> Sighting:
    half = side / 2
    box = np.array([column - half, 100 - half, column + half, 100 + half])
    return Sighting(frame, box, looks(who, off))


def sightings() -> list[Track]:
    """Both in the first shot, drifting; in the second the one on the right alone."""
    first = [[face(t, LEFT + t, 40, 0), face(t, RIGHT - t, 60, 1)] for t in range(0, CUT, 5)]
    return first + [[face(t, RIGHT, 60, 1)] for t in range(CUT, FRAMES, 5)]


def place(frame: int, x: float, y: float) -> Person:
    return Person((Place(frame, np.array([x, y])),))


def columns(box: np.ndarray) -> np.ndarray:
    return np.asarray(box[:, [0, 2]].mean(1))


def test_the_largest_face_is_followed_in_every_shot() -> None:
    found = follow(sightings(), SEGMENT)
    assert found.distance.tolist() == [0, 0]
    assert found.sighted.sum() == 8
    np.testing.assert_allclose(columns(found.box)[:15], RIGHT - np.arange(15))


def test_a_head_that_lies_in_a_shot_is_turned_upright_in_it() -> None:
    tilts = np.radians([-50, 40, 10, 5, 95, 130, 80, 100])
    tilted = [
        [replace(face, tilt=tilt) for face in faces]
        for faces, tilt in zip(sightings(), tilts, strict=True)
    ]
    assert follow(sightings(), SEGMENT).turns.tolist() == [0] * FRAMES
    assert follow(tilted, SEGMENT).turns.tolist() == [0] * CUT + [1] * (FRAMES - CUT)
    other_way = [[replace(face, tilt=-face.tilt) for face in faces] for faces in tilted]
    assert follow(other_way, SEGMENT).turns.tolist() == [0] * CUT + [3] * (FRAMES - CUT)


def test_the_face_at_a_point_is_found_again_by_its_looks() -> None:
    found = follow(sightings(), SEGMENT, [place(12, 115, 90)])
    np.testing.assert_array_equal(found.distance, [0, np.nan])  # the second shot shows another
    np.testing.assert_allclose(columns(found.box)[:15], LEFT + np.arange(15))
    found = follow(sightings(), SEGMENT, [place(12, 285, 90)])
    assert found.distance[1] == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(columns(found.box)[FRAMES - 1], RIGHT)


def test_a_point_wins_over_looks() -> None:
    both = Person((*place(0, 105, 95).places, *place(39, 290, 100).places))
    found = follow(sightings(), SEGMENT, [both])
    assert found.distance.tolist() == [0, 0]
    np.testing.assert_allclose(columns(found.box)[[0, 39]], [LEFT, RIGHT])


def test_each_face_goes_to_whom_it_is_most_like() -> None:
    """The second shot shows the other person a little more like the first than is usual."""
    later = [[face(t, RIGHT, 60, 1, -2.9)] for t in range(CUT, FRAMES, 5)]
    seen = sightings()[:4] + later
    ann, ben = place(12, 115, 90), place(12, 285, 90)
    assert np.isnan(follow(seen, SEGMENT, [ann]).distance[1])  # 2.1 away: nobody's
    nearer = sightings()[:4] + [[face(t, RIGHT, 60, 1, -3.4)] for t in range(CUT, FRAMES, 5)]
    assert follow(nearer, SEGMENT, [ann]).distance[1] == pytest.approx(1.6)
    elsewhere = Person(looks=looks(1, -3.3)[None])
    assert np.isnan(follow(nearer, SEGMENT, [ann, elsewhere]).distance[1])
    assert follow(nearer, SEGMENT, [elsewhere, ann]).distance[1] == pytest.approx(0.1)
    with pytest.raises(LookupError, match="like theirs"):
        follow(seen, SEGMENT, [Person(looks=looks(4)[None]), ben])


def test_nobody_is_at_two_places_at_a_time_but_may_come_back() -> None:
    """A third face like Ann's beside her, and hers again after a pillar, elsewhere."""
    one = np.zeros(FRAMES, int)
    seen = [[face(t, LEFT, 40, 0), face(t, RIGHT, 60, 0, 0.5)] for t in (0, 5, 10)]
    seen += [[face(t, 200.0, 40, 0, 0.2)] for t in (20, 25)]
    found = follow(seen, one, [place(0, LEFT, 100)])
    np.testing.assert_allclose(columns(found.box)[[0, 10, 25]], [LEFT, LEFT, 200])
    assert found.sighted.sum() == 5
    assert found.distance == pytest.approx([0.2])


@pytest.mark.parametrize("person", [place(12, 200, 100), place(30, 0, 0)])
def test_a_point_beside_every_face_is_reported(person: Person) -> None:
    with pytest.raises(LookupError, match=f"of frame {person.places[0].frame}"):
        follow(sightings(), SEGMENT, [person])


def test_the_largest_face_that_is_not_followed_is_known() -> None:
    def sighting(frame: int, middle: float, size: float) -> Sighting:
        box = np.array([middle - size / 2, 0, middle + size / 2, size])
        return Sighting(frame, box, np.zeros(2))

    first = [sighting(0, 100, 80), sighting(0, 300, 40)]
    seen = [first, [sighting(1, 104, 80), sighting(1, 310, 60)]]
    box = np.array([[60.0, 0, 140, 80], [64.0, 0, 144, 80]])
    np.testing.assert_array_equal(other_face(seen, box), [1, 310, 30])
    assert np.isnan(other_face([seen[0][:1]], box)).all()


def moving(frames: int = 40) -> np.ndarray:
    """Faces (T, 478, 3) px of 40 px that cross the picture, and stop at once in the middle."""
    face = np.random.default_rng(1).uniform(-20, 20, (478, 3))
    way = 12.0 * np.minimum(np.arange(frames), frames // 2)
    return face + np.stack([way, np.zeros(frames), np.zeros(frames)], 1)[:, None]


def test_a_frame_that_shows_somebody_elses_face_is_told_from_those_around() -> None:
    points, valid, segment = moving(), np.ones(40, bool), np.repeat([0, 1], 20)
    points[20:] += 300.0  # another shot
    assert not strays(points, valid, segment).any()
    points[[9, 33, 34], :, 0] += 40
    assert np.flatnonzero(strays(points, valid, segment)).tolist() == [9, 33, 34]
    valid[[9, 33]] = False
    assert np.flatnonzero(strays(points, valid, segment)).tolist() == [34]
    assert not strays(points, np.zeros(40, bool), segment).any()
