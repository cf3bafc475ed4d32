"""A timeline becomes a manifest; what of it cannot be dubbed is named."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.errors import CallError, ExplainedError, ManifestError, MediaError
from dubbing.manifest.init import write_manifest as write_plain
from dubbing.manifest.keys import yaml_lines
from dubbing.media import MediaInfo
from dubbing.preparation.tracking.following import Sighting
from dubbing.reels import faces
from dubbing.reels.faces import Seen
from dubbing.timelines import cut_manifest, edl, reading
from tests import clips
from tests.dubbing.reels.test_reel_manifest import looks_of
from tests.dubbing.timelines import cuts
from tests.dubbing.timelines.cuts import FILM_RATE, KINDS, RATES, Piece, frames, otio, use, written


@pytest.mark.medium
@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("kind", KINDS)
def test_two_hundred_clips_to_the_frame(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kind: str, name: str
) -> None:
    rate = RATES[name]
    use(monkeypatch, rate)
    pieces = cuts.pieces(200)
    clips.write_noise(folder / "cut_it.wav", float(9000 / rate), 2000)  # none is like another
    dubs, said = written(folder, cuts.write(folder / f"cut.{kind}", pieces, rate))
    assert len(dubs) == len(pieces)
    for dub, piece in zip(dubs, pieces, strict=True):
        assert dub["clip"] == f"shot{piece.film}.mov"
        assert frames(dub, rate) == (piece.first, piece.stop)
    assert said[2] == f"0 of {len(pieces)} events lie in dubs that were there"
    if kind != "aaf":  # whose adapter writes no markers
        notes = [folder / f"{dubs[k]['name']}.edits.yaml" for k in (0, 50, 100, 150)]
        assert all(
            re.search(f"note {50 * k}", note.read_text(), re.I) for k, note in enumerate(notes)
        )


def test_the_speech_of_a_dub_is_that_of_its_place_in_the_cut(folder: Path) -> None:
    dubs, _ = written(folder, cuts.write(folder / "cut.edl", cuts.pieces(3), FILM_RATE), handles=8)
    piece, dub = cuts.pieces(3)[2], dubs[2]
    whole, rate = soundfile.read(folder / "cut_it.wav")
    own, _ = soundfile.read(folder / dub["audio"])
    first = (piece.at - 8) * rate // 25
    assert frames(dub) == (piece.first - 8, piece.stop + 8)
    assert (own == whole[first : first + len(own)]).all()
    assert len(own) == (piece.stop - piece.first + 16) * rate // 25


def test_handles_end_with_the_film(folder: Path) -> None:
    cut = [Piece(0, 3, 50, 0), Piece(1, 300, cuts.LENGTH - 2, 47)]
    dubs, _ = written(folder, cuts.write(folder / "cut.edl", cut, FILM_RATE), handles=8)
    assert [frames(dub) for dub in dubs] == [(0, 58), (292, cuts.LENGTH)]


def test_a_film_without_timecode_counts_from_where_the_timeline_says_it_begins(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, FILM_RATE, timecode=False)
    cut = cuts.pieces(2)
    dubs, _ = written(folder, cuts.write(folder / "cut.otio", cut, FILM_RATE))
    assert [frames(dub) for dub in dubs] == [(piece.first, piece.stop) for piece in cut]
    with pytest.raises(
        ManifestError, match=r"lie outside of shot0\.mov: it has 400, from no timecode"
    ):
        written(folder, cuts.write(folder / "cut.edl", cut, FILM_RATE))


def test_a_timeline_at_24_counts_the_frames_of_films_at_23_976(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, RATES["23.976"])
    cut = [Piece(6, 200, 300, 0)]
    dubs, _ = written(folder, cuts.write(folder / "cut.otio", cut, Fraction(24)))
    assert frames(dubs[0], RATES["23.976"]) == (200, 300)


def test_picture_may_begin_after_the_sound_of_an_edl(folder: Path) -> None:
    text = cuts.write(folder / "cut.edl", [Piece(0, 20, 60, 50)], FILM_RATE).read_text()
    sound = "000  AX  A  C  00:00:00:00 00:00:04:00 01:00:00:00 01:00:04:00"
    (folder / "cut.edl").write_text(text.replace("TITLE: cut\n", f"TITLE: cut\n{sound}\n"))
    (event,) = reading.read(
        folder / "cut.edl", lambda _: [cuts.info_of(Path("shot0.mov"), FILM_RATE)]
    ).events
    assert (event.record, event.timecode) == (2, "01:00:02:00")


def test_frames_of_a_dissolve_are_dubbed_too(folder: Path) -> None:
    made = cuts.timeline([Piece(0, 20, 40, 0), Piece(1, 60, 80, 20)], FILM_RATE)
    sides = cuts.time(6, FILM_RATE), cuts.time(4, FILM_RATE)
    made.tracks[0].insert(1, otio.schema.Transition("", "SMPTE_Dissolve", *sides))
    otio.adapters.write_to_file(made, str(folder / "cut.otio"))
    dubs, _ = written(folder, folder / "cut.otio")
    assert [frames(dub) for dub in dubs] == [(20, 44), (54, 80)]


def test_every_event_without_a_film_is_named_with_its_timecode(folder: Path) -> None:
    (folder / "shot1.mov").unlink()
    (folder / "b").mkdir()
    (folder / "b" / "shot2.mov").touch()
    cut = [Piece(0, 20, 40, 0), Piece(1, 20, 40, 20), Piece(2, 20, 40, 40), Piece(0, 390, 410, 60)]
    with pytest.raises(ManifestError) as caught:
        written(folder, cuts.write(folder / "cut.edl", cut, FILM_RATE))
    assert [re.sub(r" as .*", "", str(one)) for one in caught.value.problems] == [
        "event 002 at 01:00:00:20 (shot1.mov): no film is called shot1.mov or shot1",
        "event 003 at 01:00:01:15 (shot2.mov): found twice,",
        "event 004 at 01:00:02:10 (shot0.mov): frames 390 to 410 lie outside of shot0.mov:"
        " it has 400, from 01:00:00:00 on",
    ]
    assert not (folder / "manifest.yaml").exists()


def test_numbered_images_are_one_film_whose_rate_must_be_known(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = cuts.timeline([Piece(0, 20, 60, 0)], FILM_RATE)
    media = otio.schema.ImageSequenceReference("/elsewhere", "shot9.", ".exr", 1001, 1, 25, 4)
    media.available_range = made.tracks[0][0].media_reference.available_range
    made.tracks[0][0].media_reference = media
    otio.adapters.write_to_file(made, str(folder / "cut.otio"))
    for k in range(1001, 1004):
        (folder / f"shot9.{k}.exr").touch()
    image = cuts.info_of(Path("shot0.mov"), FILM_RATE)

    def of_images(path: Path) -> MediaInfo:
        assert path.name == "shot9.####.exr"
        return replace(image, path=path)

    def unknown(path: Path) -> MediaInfo:
        raise MediaError("no frame rate", path.name, "give `rate`")

    monkeypatch.setattr(cut_manifest, "probe", unknown)
    with pytest.raises(
        ManifestError, match=r"event 001 at 01:00:00:00 \(shot9\.####\.exr\): no fr"
    ):
        written(folder, folder / "cut.otio")
    monkeypatch.setattr(cut_manifest, "probe", of_images)
    dubs, _ = written(folder, folder / "cut.otio")
    assert (dubs[0]["clip"], dubs[0]["name"]) == ("shot9.####.exr", "shot9_000020")


def test_handles_are_those_of_a_timeline(folder: Path) -> None:
    result = CliRunner().invoke(app, ["init", str(folder), "--handles", "3"])
    assert isinstance(result.exception, CallError)


def test_the_rate_of_an_edl_is_that_of_its_films(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(4), FILM_RATE)

    def probe(path: Path) -> MediaInfo:
        return cuts.info_of(path, FILM_RATE if path.stem == "shot0" else Fraction(24))

    monkeypatch.setattr(cut_manifest, "probe", probe)
    with pytest.raises(ExplainedError, match="its films have 24, 25 frames a second"):
        written(folder, cut)
    for k in range(7):
        (folder / f"shot{k}.mov").unlink()
    with pytest.raises(ExplainedError, match="no film is called as one in it"):
        written(folder, cut)


def test_a_film_whose_name_is_part_of_anothers_is_not_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As shot1 in a list of shot10: its rate is not that of the list."""
    cut = cuts.write(folder / "cut.edl", [Piece(0, 21, 40, 0)], FILM_RATE)
    (folder / "shot0.mov").rename(folder / "shot00.mov")
    cut.write_text(cut.read_text().replace("shot0", "shot00"))
    (folder / "shot0.mov").touch()

    def probe(path: Path) -> MediaInfo:
        return cuts.info_of(path, FILM_RATE if path.stem == "shot00" else Fraction(24))

    monkeypatch.setattr(cut_manifest, "probe", probe)
    dubs, _ = written(folder, cut)
    assert [dub["clip"] for dub in dubs] == ["shot00.mov"]


def test_a_clip_at_another_rate_than_its_film_is_refused(folder: Path) -> None:
    cut = cuts.write(folder / "cut.otio", [Piece(0, 21, 40, 0)], Fraction(24))
    with pytest.raises(ManifestError, match="between frames: it has 24 frames a second"):
        written(folder, cut)


@pytest.mark.parametrize("tracks", [("A",), ("AA",), ("A", "A2"), ("A2",)])
def test_an_event_may_have_a_row_for_each_track(folder: Path, tracks: tuple[str, ...]) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(3), FILM_RATE)
    expected, _ = written(folder, cut, handles=0)
    rows = []
    for row in cut.read_text().splitlines():
        rows.append(row)
        if re.match(r"\d+ ", row):
            rows += [re.sub(r" V ", f" {track} ", row) for track in tracks]
    assert len(rows) == len(cut.read_text().splitlines()) + 3 * len(tracks)
    cut.write_text("\n".join(rows) + "\n")
    (folder / "manifest.yaml").unlink()
    found, _ = written(folder, cut, handles=0)
    assert found == expected


@pytest.mark.parametrize(
    ("pattern", "instead"),
    [
        (r"(\d\d):(\d\d):(\d\d);(\d\d)", r"\1;\2;\3;\4"),  # Premiere
        (r"(\d\d):(\d\d):(\d\d);(\d\d)", r"\1:\2:\3:\4"),  # lists for tapes
    ],
)
def test_an_edl_says_in_several_ways_that_frames_are_dropped(
    folder: Path, monkeypatch: pytest.MonkeyPatch, pattern: str, instead: str
) -> None:
    """Two hours into the day frames are numbered 216 further, or lie outside of the films."""
    use(monkeypatch, RATES["29.97"])
    cut = cuts.write(folder / "cut.edl", cuts.pieces(9), RATES["29.97"])
    expected, _ = written(folder, cut)
    title, _, events = cut.read_text().partition("\n")
    assert ";" in events
    cut.write_text(f"{title}\nFCM: DROP FRAME\n{re.sub(pattern, instead, events)}")
    (folder / "manifest.yaml").unlink()
    assert written(folder, cut)[0] == expected


@pytest.mark.parametrize("event", ["001", "002"])
def test_an_event_of_an_edl_may_be_faded_in_from_black(folder: Path, event: str) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(3), FILM_RATE)
    expected, _ = written(folder, cut)
    text, zero = cut.read_text(), "00:00:00:00 00:00:00:00"
    (row,) = (row for row in text.splitlines() if row.startswith(event))
    *_, begin, _ = row.split()
    black = f"{event}  BL       V     C        {zero} {begin} {begin}"
    film = f"shot{int(event) - 1}"
    text = text.replace(row, f"{black}\n{row.replace('C       ', 'D    012')}")
    text = text.replace(f"* FROM CLIP NAME:  {film}", f"* TO CLIP NAME:  {film}")
    cut.write_text(text)
    assert "* TO CLIP" in text
    assert " D    012 " in text
    (folder / "manifest.yaml").unlink()
    assert written(folder, cut)[0] == expected


def test_a_semicolon_in_a_comment_drops_no_frames(folder: Path) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(3), RATES["29.97"])
    text = cut.read_text().replace(";", ":") + "* COMMENT: later; 10;00\n"
    assert not edl.dropped(edl.plain(text, drops=True))


@pytest.mark.parametrize("mark", ["* SOURCE FILE:", "*SOURCE FILE:"])
def test_a_film_is_found_by_the_source_file_of_an_edl(folder: Path, mark: str) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(3), FILM_RATE)
    rows = [row for row in cut.read_text().splitlines() if not row.startswith("*")]
    at = next(k for k, row in enumerate(rows) if row.startswith("002"))
    rows[at] = rows[at].replace("shot1", "AX   ")
    cut.write_text("\n".join([*rows[: at + 1], f"{mark} C:\\films\\shot1.mov", *rows[at + 1 :]]))
    dubs, _ = written(folder, cut)
    assert [dub["clip"] for dub in dubs] == ["shot0.mov", "shot1.mov", "shot2.mov"]


@pytest.mark.parametrize(
    ("speed", "kept"),
    [
        ("050.0                01:00:40:00", [[1], [3]]),
        ("-25.0                01:00:40:00", [[1], [3]]),
        ("000.0                01:00:40;00", [[1], [3]]),
        ("025.0                01:00:40:00", [[1], [2], [3]]),
    ],
)
def test_a_changed_speed_of_an_edl_is_said(folder: Path, speed: str, kept: list[list[int]]) -> None:
    """Even if the event is as long as its source: a list may give the length on tape alone."""
    cut = cuts.write(folder / "cut.edl", cuts.pieces(3), FILM_RATE)
    rows = cut.read_text().splitlines()
    second = next(k for k, row in enumerate(rows) if row.startswith("002"))
    cut.write_text("\n".join([*rows[: second + 1], f"M2   shot1    {speed}", *rows[second + 1 :]]))
    dubs, said = written(folder, cut)
    assert [dub["events"] for dub in dubs] == kept
    assert any("its speed is changed" in one for one in said) == (len(kept) == 2)


@pytest.mark.parametrize("what", ["nested", "retimed"])
def test_what_cannot_be_dubbed_is_said(folder: Path, what: str) -> None:
    made = cuts.timeline(cuts.pieces(3), FILM_RATE)
    clip = made.tracks[0][1]
    if what == "nested":
        inner = otio.schema.Stack("inner", source_range=cuts.span(0, 20, FILM_RATE))
        made.tracks[0][1] = inner
    else:
        clip.effects.append(otio.schema.LinearTimeWarp(time_scalar=2.0))
    otio.adapters.write_to_file(made, str(folder / "cut.otio"))
    dubs, said = written(folder, folder / "cut.otio")
    assert [dub["events"] for dub in dubs] == [[1], [3]]
    words = {"nested": "composition in itself", "retimed": "its speed is changed"}[what]
    assert any(words in one and "event 002 at 01:00:0" in one for one in said)


def test_a_speed_of_100_percent_is_none(folder: Path) -> None:
    made = cuts.timeline(cuts.pieces(3), FILM_RATE)
    made.tracks[0][1].effects.append(otio.schema.LinearTimeWarp(time_scalar=1.0))
    otio.adapters.write_to_file(made, str(folder / "cut.otio"))
    dubs, _ = written(folder, folder / "cut.otio")
    assert [dub["events"] for dub in dubs] == [[1], [2], [3]]


def test_a_track_that_is_off_is_not_dubbed(folder: Path) -> None:
    made = cuts.timeline(cuts.pieces(3), FILM_RATE)
    made.tracks.append(made.tracks[0].deepcopy())
    made.tracks[0].enabled = False
    del made.tracks[1][1:]
    otio.adapters.write_to_file(made, str(folder / "cut.otio"))
    dubs, _ = written(folder, folder / "cut.otio")
    assert [dub["events"] for dub in dubs] == [[1]]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("content", [b"", b"shot0 \xff\x00", b"shot0 is no timeline", b"{}"])
def test_what_is_no_timeline_is_refused(folder: Path, kind: str, content: bytes) -> None:
    (folder / f"cut.{kind}").write_bytes(content)
    with pytest.raises(ExplainedError, match=f"cut.{kind}"):
        written(folder, folder / f"cut.{kind}")


def test_a_timeline_of_nothing_is_refused(folder: Path) -> None:
    path = folder / "cut.otio"
    for made in (otio.schema.Timeline("empty"), cuts.timeline([], FILM_RATE)):
        otio.adapters.write_to_file(made, str(path))
        with pytest.raises(ManifestError, match="no clip with picture in it"):
            written(folder, path)
    made = cuts.timeline(cuts.pieces(1), FILM_RATE)
    made.tracks[0][0].source_range = None
    made.tracks[0][0].media_reference = otio.schema.MissingReference()
    otio.adapters.write_to_file(made, str(path))
    with pytest.raises(ExplainedError, match="it cannot be read as a timeline"):
        written(folder, path)


def test_another_kind_of_file_and_a_manifest_without_a_timeline_are_refused(folder: Path) -> None:
    with pytest.raises(ExplainedError, match="no kind of timeline"):
        written(folder, folder / "cut_it.wav")
    (folder / "manifest.yaml").write_text("version: 1\noutput: out\n")
    with pytest.raises(ManifestError, match="is of no timeline; nothing written"):
        written(folder, cuts.write(folder / "cut.edl", cuts.pieces(1), FILM_RATE))
    with pytest.raises(ManifestError, match="it is there already"):
        write_plain(folder)


def test_one_recording_runs_along_the_cut(folder: Path) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(1), FILM_RATE)
    clips.write_noise(folder / "shot0.wav", 1)
    written(folder, cut)  # only one is called as the cut
    (folder / "cut_it.wav").unlink()
    written(folder, cut)  # or there is only one
    (folder / "shot0.wav").unlink()
    with pytest.raises(ExplainedError, match=r"0 recordings of new speech.*one there, cut\.wav"):
        written(folder, cut)
    for name in ("cut_it.wav", "cut_de.wav"):
        clips.write_noise(folder / name, 1)
    with pytest.raises(ExplainedError, match=r"2 recordings.*: cut_de\.wav and cut_it\.wav"):
        written(folder, cut)


def seen(name: str, info: MediaInfo) -> Iterator[list[Seen]]:
    """Stands in for `faces.frames_of`: Ann before Ben in even films, Ben alone in others."""
    even = name[4] in "0246"
    for k in range(4):
        found = []
        for who, high in (("ann", 40), ("ben", 30)) if even else (("ben", 30),):
            box = np.array([10.0, 5, 30, 5 + high])
            sighting = Sighting(k, box, looks_of(who, k))
            image = np.zeros((faces.CELL, faces.CELL, 3), np.uint8)
            found.append(Seen(name, k / 25, 0.25, 0.5, sighting, image))
        yield found


def test_who_is_who_is_asked(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(faces, "frames_of", seen)
    cut = cuts.write(folder / "cut.edl", cuts.pieces(7), FILM_RATE)
    answers = ["a/b", "Ben B.", "Ben B.", "ann"]
    asked: list[str] = []

    def ask(question: str) -> str:
        asked.append(question)
        return answers[len(asked) - 1]

    said: list[str] = []
    path = cut_manifest.write_manifest(folder, cut, 0, said.append, ask)
    people = yaml_lines.read(path.read_text()).data["identities"]
    # A name that cannot be a folder's, and one that is taken, are asked for again.
    assert asked == ["Who is face 1? A name"] * 2 + ["Who is face 2? A name"] * 2
    assert {name: one["clips"] for name, one in people.items()} == {
        "Ben B.": ["shot1.mov", "shot3.mov", "shot5.mov"],
        "ann": ["shot0.mov", "shot2.mov", "shot4.mov", "shot6.mov"],
    }
    assert people["ann"]["face"] == {"at": 0.0, "x": 0.25, "y": 0.5}
    assert (folder / "manifest.faces.jpg").is_file()
    dubs = yaml_lines.read(path.read_text()).data["dubs"]
    whose = {one["clip"]: one["identity"] for one in dubs}
    assert (whose["shot1.mov"], whose["shot2.mov"]) == ("Ben B.", "ann")
    # Later cuts keep them.
    cut_manifest.write_manifest(folder, cut, 0, said.append, ask)
    assert len(asked) == 4


def test_where_nobody_is_asked_all_is_one_person(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(faces, "frames_of", seen)
    cut = cuts.write(folder / "cut.edl", cuts.pieces(3), FILM_RATE)
    path = cut_manifest.write_manifest(folder, cut, 0)
    assert [*yaml_lines.read(path.read_text()).data["identities"]] == ["person"]
    assert not (folder / "manifest.faces.jpg").exists()
