"""Whom a clip, or a part of it, is searched for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing import media
from dubbing.preparation.tracking import survey
from dubbing.preparation.tracking.following import Sighting
from dubbing.preparation.tracking.portraits import Portrait
from tests import clips

FRAMES, FIRST, COUNT = 40, 10, 20  # of the clip; of its part
LOOKS = np.array([1.0, 2.0])


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> media.MediaInfo:
    """Facts of frames 10 .. 30 of a clip that has a face in its left half throughout."""

    def sightings(faces: Any, image: np.ndarray, frame: int) -> list[Sighting]:
        return [Sighting(frame, np.array([8.0, 8, 24, 32]), LOOKS + clips.number(image))]

    monkeypatch.setattr(survey, "FaceMesh", lambda **_: lambda image: [])
    monkeypatch.setattr(survey, "sightings_of", sightings)
    return replace(media.probe(clips.write_video(tmp_path / "a.mp4", FRAMES)), frames=COUNT)


def test_a_point_in_a_part_is_a_place_of_it(part: media.MediaInfo) -> None:
    portrait = Portrait(part.path, ((15 / 25, 0.25, 0.4), (1.0, 0.25, 0.4)))
    person = survey.person_of(portrait, part, FIRST)
    assert [place.frame for place in person.places] == [15 - FIRST, 25 - FIRST]
    np.testing.assert_allclose(person.places[0].point, (16, 19.2))
    assert person.looks is None


@pytest.mark.parametrize("frame", [FIRST - 1, FIRST + COUNT])
def test_a_face_beside_the_part_says_what_to_look_for(part: media.MediaInfo, frame: int) -> None:
    portrait = Portrait(part.path, ((frame / 25, 0.25, 0.4), (15 / 25, 0.25, 0.4)))
    person = survey.person_of(portrait, part, FIRST)
    assert person.places == ()
    np.testing.assert_allclose(np.asarray(person.looks).mean(0), LOOKS + (frame + 15) / 2)


def test_where_the_point_shows_no_face_it_is_said(part: media.MediaInfo) -> None:
    with pytest.raises(LookupError, match=r"\(58, 43\) px of frame 5"):
        survey.person_of(Portrait(part.path, ((0.2, 0.9, 0.9),)), part, FIRST)
