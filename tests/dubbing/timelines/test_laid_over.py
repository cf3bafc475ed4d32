"""The timeline comes back with its dubs above, to the frame."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from dubbing.errors import ExplainedError
from dubbing.media import MediaInfo
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.script.edl import Marker
from dubbing.timelines import laid_over, reading
from dubbing.timelines.reading import Event
from tests.dubbing.timelines import cuts
from tests.dubbing.timelines.cuts import KINDS, RATES, Piece, otio

TV = RATES["29.97"]
SLOW = (("aaf", "23.976"), ("aaf", "25"))
CUT = [Piece(0, 20, 60, 0), Piece(1, 30, 50, 40), Piece(0, 100, 160, 72)]


def no_markers(_: Dub) -> list[Marker]:
    return []


def laid(
    production: Production, markers: Callable[[Dub], list[Marker]] = no_markers
) -> dict[str, Path]:
    """The files that are written, by their endings."""
    found = {}
    for name, write in laid_over.files(production, markers).items():
        write(production.output / name)
        found[Path(name).suffix] = production.output / name
    return found


def dubbed(path: Path, rate: Fraction) -> list[Event]:
    """The events of a timeline that are dubs."""

    def films(text: str) -> list[MediaInfo]:
        return [cuts.info_of(Path("shot0.mov"), rate)]

    return [one for one in reading.read(path, films).events if one.names[0].endswith(".mp4")]


def frames(event: Event) -> tuple[int, int]:
    return int(event.first), int(event.stop)


@pytest.mark.medium
@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("kind", KINDS)
def test_two_hundred_clips_come_back_to_the_frame(tmp_path: Path, kind: str, name: str) -> None:
    rate = RATES[name]
    pieces = cuts.pieces(40 if (kind, name) in SLOW else 200)
    cut = cuts.write(tmp_path / f"cut.{kind}", pieces, rate)
    written = laid(cuts.dubbed(tmp_path, pieces, rate, cut))
    assert set(written) == {f".{kind}", ".otio"}
    for path in written.values():
        events = dubbed(path, rate)
        assert len(events) == len(pieces)
        for event, piece in zip(events, pieces, strict=True):
            start = cuts.start_of(piece.film, rate)
            assert frames(event) == (start + piece.first, start + piece.stop)
            assert event.record * rate == piece.at
            # The dub begins where its name says, eight frames of handle before that.
            first = int(event.names[0].partition("_")[2].removesuffix(".mp4"))
            assert event.base is None or event.base == start + first - 8


@pytest.mark.parametrize("kind", KINDS)
def test_the_film_stays_below(tmp_path: Path, kind: str) -> None:
    cut = cuts.write(tmp_path / f"cut.{kind}", CUT, TV)
    written = laid(cuts.dubbed(tmp_path, CUT, TV, cut))
    for path in written.values():
        timeline = reading.read(path, lambda _: [cuts.info_of(Path("shot0.mov"), TV)]).timeline
        tracks = [[clip.name for clip in track.find_clips()] for track in timeline.video_tracks()]
        above = [[f"shot0_{CUT[0].first}.mp4", "shot1_30.mp4", "shot0_100.mp4"]]
        below = [["shot0", "shot1", "shot0"]] if path.suffix != ".edl" else []  # it has one track
        assert tracks == below + above


def test_an_edl_says_how_it_counts_and_names_the_dub(tmp_path: Path) -> None:
    cut = cuts.write(tmp_path / "cut.edl", CUT, TV)
    rows = laid(cuts.dubbed(tmp_path, CUT, TV, cut))[".edl"].read_text().splitlines()
    assert rows[:2] == ["TITLE: cut", "FCM: DROP FRAME"]
    assert rows[3] == (
        "001  shot0_20 V     C        01:00:00;20 01:00:02;00 01:00:00;00 01:00:01;10"
    )
    assert rows[4] == "* FROM CLIP NAME:  shot0_20.mp4"


def test_an_edl_without_dropped_frames_has_none_dropped(tmp_path: Path) -> None:
    cut = cuts.write(tmp_path / "cut.edl", CUT, TV)
    text = re.sub(r";", ":", cut.read_text()).replace("01:00:", "02:00:")
    cut.write_text(text)
    production = cuts.dubbed(tmp_path, CUT, TV, cut)
    # The same numbers, which are other frames of other films.
    first = replace(cuts.info_of(Path("shot0.mov"), TV), timecode="02:00:00:00")
    dubs = {
        name: replace(dub, film=replace(dub.film, info=replace(first, path=dub.film.path)))
        for name, dub in production.dubs.items()
        if dub.film.path.stem == "shot0"
    }
    rows = laid(replace(production, dubs=dubs))[".edl"].read_text().splitlines()
    assert rows[1] == "FCM: NON-DROP FRAME"
    assert rows[3].endswith("02:00:00:20 02:00:02:00 02:00:00:00 02:00:01:10")


def test_markers_lie_on_the_frames_of_the_cut(tmp_path: Path) -> None:
    def markers(dub: Dub) -> list[Marker]:
        # Eight frames of every dub are before the cut.
        return [Marker(0, 4, "red", "not seen"), Marker(2, 10, "green", "it passes")]

    for kind in ("otio", "fcpxml", "edl"):
        cut = cuts.write(tmp_path / f"cut.{kind}", CUT, TV)
        written = laid(cuts.dubbed(tmp_path, CUT, TV, cut), markers)[f".{kind}"]
        event = dubbed(written, TV)[0]
        assert [note.lower() for note in event.notes] == ["it passes"]
        marked = event.clip.markers[0].marked_range
        assert kind == "edl" or marked.start_time.value == event.first
        assert kind != "otio" or marked.duration.value == 2  # the others have no length
    rows = [row for row in written.read_text().splitlines() if row.startswith("* LOC")]
    assert rows == [  # on the clock of the cut
        f"* LOC: 01:00:{second} GREEN   IT PASSES" for second in ("00;00", "01;10", "02;12")
    ]


def test_a_film_without_timecode_gives_dubs_that_count_from_zero(tmp_path: Path) -> None:
    cut = cuts.write(tmp_path / "cut.otio", CUT, TV)
    production = cuts.dubbed(tmp_path, CUT, TV, cut, timecode=False)
    events = dubbed(laid(production)[".otio"], TV)
    assert [frames(event) for event in events] == [(8, 48), (8, 28), (8, 68)]
    assert events[0].base == 0


def test_of_two_dubs_of_the_same_frames_the_one_for_the_event_is_taken(tmp_path: Path) -> None:
    twice = [Piece(0, 20, 60, 0), Piece(1, 20, 60, 40), Piece(0, 20, 60, 80)]
    cut = cuts.write(tmp_path / "cut.otio", twice, TV)
    production = cuts.dubbed(tmp_path, twice, TV, cut)
    first = production.dubs["shot0_20"]
    dubs = {"other": replace(first, name="other", events=(3,)), **production.dubs}
    dubs["shot0_20"] = replace(first, events=(1,))
    (production.output / "other.mp4").touch()
    events = dubbed(laid(replace(production, dubs=dubs))[".otio"], TV)
    assert [one.names[0] for one in events] == ["shot0_20.mp4", "shot1_20.mp4", "other.mp4"]


def test_a_dub_for_an_event_need_not_be_of_a_film_of_its_name(tmp_path: Path) -> None:
    cut = cuts.write(tmp_path / "cut.edl", CUT[:1], TV)
    production = cuts.dubbed(tmp_path, CUT[:1], TV, cut)
    (dub,) = production.dubs.values()
    film = replace(dub.film, path=Path("a1b2"), info=replace(dub.info, path=Path("a1b2")))
    linked = replace(dub, film=film, events=(1,))
    (event,) = dubbed(laid(replace(production, dubs={"it": linked}))[".otio"], TV)
    assert int(event.first) == cuts.start_of(0, TV) + 20


def test_a_dissolve_between_two_dubs_is_kept(tmp_path: Path) -> None:
    made = cuts.timeline([Piece(0, 20, 60, 0), Piece(1, 30, 50, 40), Piece(2, 9, 60, 60)], TV)
    for place in (1, 3):
        sides = cuts.time(4, TV), cuts.time(4, TV)
        made.tracks[0].insert(place, otio.schema.Transition("", "SMPTE_Dissolve", *sides))
    otio.adapters.write_to_file(made, str(tmp_path / "cut.otio"))
    cut = [Piece(0, 20, 60, 0), Piece(1, 30, 50, 40)]
    production = cuts.dubbed(tmp_path, cut, TV, tmp_path / "cut.otio")
    timeline: Any = otio.adapters.read_from_file(str(laid(production)[".otio"]))
    kinds = [type(item).__name__ for item in timeline.tracks[1]]
    assert kinds == ["Clip", "Transition", "Clip", "Gap"]


def test_events_without_a_dub_are_said(tmp_path: Path) -> None:
    made = cuts.timeline(cuts.pieces(4), TV)
    made.tracks[0][0].effects.append(otio.schema.FreezeFrame())
    otio.adapters.write_to_file(made, str(tmp_path / "cut.otio"))
    production = cuts.dubbed(tmp_path, cuts.pieces(3), TV, tmp_path / "cut.otio")
    assert laid_over.warnings(production) == [
        "cut.otio: no dub for 2 of 4 events",
        "cut.otio: event 001 at 01:00:00;00 (shot0.mov): its speed is changed:"
        " write a film of it, and cut that in",
    ]
    assert laid_over.warnings(replace(production, timeline=None)) == []


def test_a_dub_that_was_not_made_is_not_laid_over(tmp_path: Path) -> None:
    cut = cuts.write(tmp_path / "cut.edl", CUT, TV)
    production = cuts.dubbed(tmp_path, CUT, TV, cut)
    (production.output / "shot1_30.mp4").unlink()
    events = dubbed(laid(production)[".otio"], TV)
    assert [one.names[0] for one in events] == ["shot0_20.mp4", "shot0_100.mp4"]
    assert [one.record * TV for one in events] == [0, 72]


def test_two_tracks_of_dubs_are_no_edl() -> None:
    made = cuts.timeline(CUT, TV)
    made.tracks.append(made.tracks[0].deepcopy())
    cut = reading.cut_of(made)
    with pytest.raises(ExplainedError, match="an EDL holds one track, and 2 have dubs"):
        laid_over.edl(cut, list(made.tracks))
