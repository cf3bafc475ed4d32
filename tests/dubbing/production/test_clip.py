"""Parts of clips: what is learned from and dubbed of a long one."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.mixing.sound import Sound
from dubbing.pipeline import dub_job, people_jobs
from dubbing.production.clip import PersonClip
from dubbing.production.dub import Dub
from dubbing.production.person import Consent, Person
from dubbing.script.timeline import Cue
from dubbing.stages.check_source import CheckSource
from dubbing.stages.prepare import Prepare
from dubbing.stages.refine_poses import RefinePoses
from tests.dubbing.timelines.cuts import info_of

RATE = Fraction(25)
MINUTE = 60 * 25


def clip(minutes: float, rate: Fraction = RATE, name: str = "") -> PersonClip:
    """A clip that lasts so long."""
    frames = round(minutes * 60 * rate)
    return PersonClip(
        Path("/film.mp4"), replace(info_of(Path("shot1.mov"), rate), frames=frames), name=name
    )


@pytest.mark.parametrize(
    ("start", "end", "minutes"),
    [
        (0, 15, (0, 1)),
        (70, 80, (1, 2)),
        (55, 57, (0, 1)),
        (55, 59, (0, 2)),  # 2 s beside it are in the part, too
        (61, 70, (0, 2)),
        (200, 400, (3, 7)),
        (590, 605, (9, 10.5)),  # the end of the clip
    ],
)
def test_a_part_has_whole_minutes_and_something_beside_what_it_is_for(
    start: float, end: float, minutes: tuple[float, float]
) -> None:
    low, high = minutes
    assert clip(10.5).part_with(start, end).part == (round(low * MINUTE), round(high * MINUTE))


def test_a_part_of_another_rate_begins_at_the_frame_of_its_minute() -> None:
    ntsc = Fraction(30000, 1001)
    assert clip(10, ntsc).part_with(70, 80).part == (1798, 3596)


def test_a_short_clip_and_one_of_which_all_is_used_are_whole() -> None:
    assert clip(1.9).part_with(10, 20).part is None
    assert clip(3).part_with(10, 170).part is None
    assert PersonClip(Path("/damaged.mp4")).part_with(10, 20).part is None


@pytest.fixture
def ann() -> Person:
    """Somebody who is learned from the first 15 s of ten minutes."""
    own = clip(10)
    return Person(
        name="ann",
        clips=(own,),
        learned=(own,),
        consent=Consent({}, {}),
        start=0.0,
        seconds=15.0,
        size=256,
        settings=FinetuneSettings(),
        speech_files={},
    )


def dub_at(person: Person, name: str, second: float, seconds: float = 5.0) -> Dub:
    """A dub of a line of a person, which begins at a second of their film."""
    frames = round(seconds * RATE)
    cue = Cue("ann", 0, frames, Path("/speech.wav"), 0.0, seconds)
    first = round(second * RATE)
    return Dub(name, (person,), person.clip, Sound((cue,)), length=frames, first=first)


def test_a_dub_waits_for_the_minutes_that_are_learned_and_those_under_it(
    ann: Person, tmp_path: Path
) -> None:
    dubs = [dub_at(ann, "near", 20), dub_at(ann, "late", 310), dub_at(ann, "later", 320)]
    people = people_jobs([ann], dubs, tmp_path)
    job = people["ann"]
    assert {s.id.of: s.part for s in job.all_of(Prepare)} == {
        "": (0, MINUTE),
        "film@300-360s": (5 * MINUTE, 6 * MINUTE),
    }
    assert {s.id.of: s.part for s in job.all_of(CheckSource)} == {
        s.id.of: s.part for s in job.all_of(Prepare)
    }
    assert len(job.all_of(RefinePoses)) == 2
    for dub, minute in zip(dubs, (0, 5, 5), strict=True):
        made = dub_job(dub, people, tmp_path)
        under = made.all_of(Prepare) or [
            s for s in job.all_of(Prepare) if s.part == dub.film_of(ann).part
        ]
        assert [s.part for s in under] == [(minute * MINUTE, (minute + 1) * MINUTE)]


def test_a_line_in_another_minute_changes_nothing_that_is_learned(
    ann: Person, tmp_path: Path
) -> None:
    alone = people_jobs([ann], [dub_at(ann, "near", 20)], tmp_path)["ann"]
    both = [dub_at(ann, "near", 20), dub_at(ann, "late", 310)]
    more = people_jobs([ann], both, tmp_path)["ann"]
    assert all(more.stages[id] == stage for id, stage in alone.stages.items())


def test_a_dub_that_goes_on_beyond_the_film_has_all_of_it_beside_what_is_learned(
    ann: Person,
) -> None:
    film = dub_at(ann, "long", 580, 30).film_of(ann)
    assert film.part is None
    assert film.name != ann.for_dubs().clip.name
    assert film.used_frames == 10 * MINUTE


def test_what_is_learned_of_a_long_clip_is_said(ann: Person) -> None:
    assert ann.learned_minutes() == [
        "identities.ann: of film.mp4 learned from 0:00 to 1:00 alone, turned heads included; "
        "`start` chooses other minutes"
    ]
    assert replace(ann, start=None).learned_minutes() == []


def test_the_best_seconds_are_looked_for_everywhere(ann: Person) -> None:
    best = replace(ann, start=None)
    assert best.for_dubs().clip.part is None
    assert dub_at(best, "late", 310).film_of(best).part == (5 * MINUTE, 6 * MINUTE)
