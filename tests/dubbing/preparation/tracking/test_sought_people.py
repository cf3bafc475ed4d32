"""Whom a clip, or a part of it, is searched for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from dubbing import media
from dubbing.face.mesh_points import RIGID
from dubbing.preparation.tracking import sought_people
from dubbing.preparation.tracking.following import Sighting
from dubbing.preparation.tracking.portraits import Portrait
from tests import clips

FRAMES, FIRST, COUNT = 40, 10, 20  # of the clip; of its part
GRIMACE = 15  # frame in which the face looks otherwise than in all others
CUT = 32  # frame from which on somebody else is at the same place
LOOKS = np.random.default_rng(0).normal(size=3 * len(RIGID) + 42)


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> media.MediaInfo:
    """Facts of frames 10 .. 30 of a clip that has a face in its left half throughout."""

    def sightings(faces: Any, image: np.ndarray, frame: int) -> list[Sighting]:
        assert clips.number(image) == frame
        own = LOOKS.copy() if frame < CUT else np.roll(LOOKS, 3)
        own[-1] += 2.5 * (frame == GRIMACE)
        return [Sighting(frame, np.array([8.0, 8, 24, 32]), own)]

    mesh = Mock(find=lambda images, **_: [[] for _ in images])
    monkeypatch.setattr(sought_people, "FaceMesh", lambda **_: mesh)
    monkeypatch.setattr(sought_people, "sightings_of", sightings)
    return replace(media.probe(clips.write_video(tmp_path / "a.mp4", FRAMES)), frames=COUNT)


def test_a_point_in_a_part_is_a_place_of_it(part: media.MediaInfo) -> None:
    portrait = Portrait(part.path, ((15 / 25, 0.25, 0.4), (1.0, 0.25, 0.4)))
    person = sought_people.person_of(portrait, part, FIRST)
    assert [place.frame for place in person.places] == [15 - FIRST, 25 - FIRST]
    np.testing.assert_allclose(person.places[0].point, (16, 19.2))
    assert person.looks is None


@pytest.mark.parametrize("frame", [FIRST - 1, FIRST + COUNT])
def test_a_face_beside_the_part_says_what_to_look_for(part: media.MediaInfo, frame: int) -> None:
    person = sought_people.person_of(Portrait(part.path, ((frame / 25, 0.25, 0.4),)), part, FIRST)
    assert person.places == ()
    np.testing.assert_allclose(np.median(np.asarray(person.looks), 0), LOOKS)


def test_looks_are_those_of_most_frames_round_a_point_up_to_a_cut(part: media.MediaInfo) -> None:
    """Of a frame alone they would be those of a grimace."""
    portrait = Portrait(part.path, ((GRIMACE / 25, 0.25, 0.4),))
    looks = np.asarray(sought_people.person_of(portrait, replace(part, frames=2)).looks)
    assert len(looks) == 7  # frames 0, 5 .. 30; then somebody else
    np.testing.assert_allclose(np.median(looks, 0), LOOKS)


def test_where_the_point_shows_no_face_it_is_said(part: media.MediaInfo) -> None:
    with pytest.raises(LookupError, match=r"\(58, 43\) px of frame 5"):
        sought_people.person_of(Portrait(part.path, ((0.2, 0.9, 0.9),)), part, FIRST)
