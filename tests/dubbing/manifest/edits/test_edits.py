"""Edits of lines in a manifest: whose they are, and everything that cannot be."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.errors import ManifestError
from dubbing.manifest.edits import edits_file
from dubbing.manifest.keys import edit_entry as entry
from dubbing.manifest.manifest import load
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue
from tests import clips

pytestmark = pytest.mark.medium

SRT = """1
00:00:00,500 --> 00:00:01,000
ANN: One.

2
00:00:01,200 --> 00:00:01,600
CAT: Two.

3
00:00:02,000 --> 00:00:02,500
ANN: Three.
"""
FACE = "{at: 0, x: 0.5, y: 0.5}"
SCENE = "lines: it.srt, speakers: {ANN: ann}, audio: track.wav"
ALONE = "{name: it, identity: WHO, audio: track.wav, audio_seconds: 1, edits: EDITS}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("edits")
    clips.write_clip(place / "film.mp4", 75)
    for name in ("track", "other"):
        clips.write_sound(place / f"{name}.wav", 3)
    (place / "it.srt").write_text(SRT)
    (place / "twice.srt").write_text(SRT.replace("3\n00:00:02", "1\n00:00:02"))
    (place / "both.srt").write_text("1\n00:00:00,500 --> 00:00:01,000\n- ANN: Hi.\n- BEN: Yes.\n")
    return place


def written(folder: Path, dub: str) -> Path:
    path = folder / "m.yaml"
    people = {"ann": "fast", "ben": "fast", "old": "paper", "mute": "nerf"}
    shared = f"clip: film.mp4, seconds: 1, face: {FACE}, consent: {clips.CONSENT}"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        + "".join(f"  {name}: {{preset: {kind}, {shared}}}\n" for name, kind in people.items())
        + f"dubs:\n  - {dub}\n"
    )
    return path


def scene(folder: Path, edits: str, lines: str = SCENE) -> Path:
    return written(folder, f"{{{lines}, edits: {edits}}}")


def edits(path: Path) -> list[Edit]:
    (dub,) = load(path).dubs.values()
    return [cue.edit for cue in dub.cues]


def problems(path: Path) -> list[str]:
    with pytest.raises(ManifestError) as caught:
        load(path)
    return [str(problem) for problem in caught.value.problems]


def test_an_edit_is_of_its_line(folder: Path) -> None:
    assert edits(scene(folder, "{line: 3, shift: -40}")) == [Edit(), Edit(shift=-40)]
    both = "[{line: 3, strength: 0}, {line: 1, strength: 1.5, note: louder}]"
    assert edits(scene(folder, both)) == [Edit(0, 1.5, "louder"), Edit(0, 0)]
    assert edits(scene(folder, "[]")) == [Edit(), Edit()]


def test_keys_are_moments_of_a_line(folder: Path) -> None:
    keys = "keys: [{at: 0.2, strength: 0}, {at: 0.1, strength: 1.5}]"
    (_, edit) = edits(scene(folder, f"{{line: 3, {keys}, note: shut on the m}}"))
    assert edit.keys == ((0.2, 0.0), (0.1, 1.5))
    assert edit.in_words() == "0 at 0.2 s, 1.5 at 0.1 s: shut on the m"


def test_parts_of_a_line_are_left_to_the_film(folder: Path) -> None:
    spans = "film_mouth: [{start: 0.1, end: 0.2}, {start: 0.3, end: 9}]"
    (_, edit) = edits(scene(folder, f"{{line: 3, {spans}}}"))
    assert edit.film_mouth == ((0.1, 0.2), (0.3, 9.0))
    assert edit.in_words() == "the film's own mouth from 0.1 to 0.2 s, 0.3 to 9 s"


def test_a_line_has_a_style(folder: Path) -> None:
    (_, edit) = edits(scene(folder, "{line: 3, style: softer, strength: 0.5}"))
    assert edit == Edit(strength=0.5, style="softer")
    assert edit.in_words() == "strength 0.5, softer"


def test_parts_of_a_line_are_moved(folder: Path) -> None:
    parts = "{start: 0.1, end: 0.2, shift: 40}, {start: 0.3, end: 0.4, shift: -60}"
    (_, edit) = edits(scene(folder, f"{{line: 3, moved: [{parts}]}}"))
    assert edit.moved == ((0.1, 0.2, 40.0), (0.3, 0.4, -60.0))
    assert edit.in_words() == "0.1 to 0.2 s 40 ms later, 0.3 to 0.4 s 60 ms earlier"


def test_the_chosen_take_counts(folder: Path) -> None:
    takes = "strength: 0.5, takes: {wide: {strength: 1.2, shift: 40}, shut: {strength: 0}}"
    (_, edit) = edits(scene(folder, f"{{line: 3, note: a, {takes}, take: wide}}"))
    assert replace(edit, takes=()) == Edit(40, 1.2, "a", take="wide")
    assert [name for name, _ in edit.takes] == ["", "wide", "shut"]
    assert dict(edit.takes)["shut"] == Edit(strength=0, take="shut")
    assert edit.in_words() == "take wide, the mouth 40 ms later, strength 1.2: a"
    (_, edit) = edits(scene(folder, f"{{line: 3, {takes}}}"))
    assert replace(edit, takes=()) == Edit(strength=0.5)


def test_a_take_may_be_another_recording(folder: Path) -> None:
    clips.write_sound(folder / "again.wav", 0.5)
    takes = "takes: {again: {audio: again.wav, shift: 40}, late: {shift: 80}}"

    def cue_of(take: str) -> Cue:
        path = scene(folder, f"{{line: 3, take: '{take}', {takes}}}")
        return load(path).dubs["it"].cues[1]

    plain, late, again = (cue_of(take) for take in ("", "late", "again"))
    assert (plain.audio.name, plain.audio_start) == ("track.wav", 2.0)
    assert (late.audio, late.audio_start) == (plain.audio, 2.0)
    # It begins with the first frame of the line, whose frames stay.
    assert (again.audio.name, again.audio_start) == ("again.wav", 0)
    assert again.name == plain.name
    assert again.edit.in_words() == "take again, recording again.wav, the mouth 40 ms later"
    # Takes of one recording share what was heard in it, and nothing else.
    assert late.recorded == plain.recorded == plain.taken
    assert len({plain.taken, late.taken, again.taken, again.recorded}) == 3
    assert again.taken.startswith(f"{plain.name}/takes/again-")


def test_takes_of_like_names_have_folders_of_their_own(folder: Path) -> None:
    cue = load(scene(folder, "[]")).dubs["it"].cues[0]
    names = [cue.folder_of(take) for take in ("Again!", "again", "../x", "..", "\u00e9" * 60)]
    assert len({*names}) == len(names)
    assert all(re.fullmatch(rf"{cue.name}/takes/[a-z0-9-]+", name) for name in names)


def test_a_dub_of_one_recording_is_as_long_as_that_of_its_take(folder: Path) -> None:
    edit = "{take: TAKE, takes: {again: {audio: again.wav}}}"
    clips.write_sound(folder / "again.wav", 0.5)
    whole = ALONE.replace("WHO", "ann").replace(", audio_seconds: 1", "").replace("EDITS", edit)
    lengths = {}
    for take in ("''", "again"):
        dub = load(written(folder, whole.replace("TAKE", take))).dubs["it"]
        lengths[take] = (dub.length, dub.cues[0].audio.name, dub.length_of_take)
    assert lengths == {"''": (75, "track.wav", True), "again": (13, "again.wav", True)}


@pytest.mark.parametrize(
    ("take", "where", "words"),
    [
        ("{audio: nothing.wav}", "takes.a.audio", "no such file"),
        ("{audio: it.srt}", "takes.a.audio", None),
        ("{audio: silent.mp4}", "takes.a.audio", "no sound in"),
        ("{audio: track.wav}", "takes.a.audio", "3.00 s in line 3 of 0.48 s: shorten"),
    ],
)
def test_a_recording_that_does_not_fit_is_refused(
    folder: Path, take: str, where: str, words: str | None
) -> None:
    if not (folder / "silent.mp4").exists():
        clips.ffmpeg("-i", folder / "film.mp4", "-an", folder / "silent.mp4")
    edit = f"{{line: 3, take: a, takes: {{a: {take}}}}}"
    if words is None:  # damaged, which stops this dub alone
        assert load(scene(folder, edit)).dubs["it"].blocked
        return
    (problem,) = problems(scene(folder, edit))
    assert f"dubs[0].edits.{where}" in problem
    assert words in problem
    if "track" in take:
        cut = load(scene(folder, edit, SCENE + ", on_longer_audio: cut"))
        assert any("track.wav: 3.00 s in line 3" in warning for warning in cut.warnings)


def test_a_missing_recording_is_told_of_where_it_is_not_chosen_too(folder: Path) -> None:
    (problem,) = problems(scene(folder, "{line: 3, takes: {a: {audio: nothing.wav}}}"))
    assert "takes.a.audio" in problem


def test_curves_are_a_file_and_the_line_in_it(folder: Path) -> None:
    table = folder / "lips.csv"
    table.write_text("line,time,opening\n3,0.1,0.2\n")
    path = scene(folder, "{line: 3, curves: lips.csv}")
    (_, edit) = edits(path)
    assert edit == Edit(curves=(table, 3))
    assert edit.in_words() == "lips of lips.csv"
    table.write_text("line,time,opening\n1,0.1,0.2\n")
    (problem,) = problems(path)
    assert problem.endswith("dubs[0].edits.curves: has no row of line 3 (lips.csv)")
    table.unlink()
    (problem,) = problems(path)
    assert "edits.curves: cannot be read as CSV: No such file" in problem


def test_the_edit_of_one_recording_needs_no_line(folder: Path) -> None:
    alone = ALONE.replace("WHO", "ann")
    for text in ("{shift: 80}", "[{shift: 80.0}]", "{line: 1, shift: 80}"):
        assert edits(written(folder, alone.replace("EDITS", text))) == [Edit(shift=80)]


def test_of_several_who_speak_in_one_cue_the_speaker_is_named(folder: Path) -> None:
    people = "speakers: {ANN: ann, BEN: ben}, audio: {ANN: track.wav, BEN: other.wav}"
    lines = f"lines: both.srt, {people}"
    (dub,) = load(scene(folder, "{line: 1, speaker: BEN, shift: 80}", lines)).dubs.values()
    assert {cue.speaker: cue.edit.shift for cue in dub.cues} == {"ANN": 0, "BEN": 80}
    (problem,) = problems(scene(folder, "{line: 1, shift: 80}", lines))
    assert problem.endswith("edits.line: 2 lines have the number 1: name its speaker")
    (problem,) = problems(scene(folder, "{line: 1, speaker: BENN}", lines))
    assert problem.endswith("'BENN' does not speak line 1; did you mean 'BEN'?")


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("{line: 3, shift: 501}", "edits.shift", "must be less than or equal to 500, not 501"),
        ("{line: 3, shift: .nan}", "edits.shift", "must be a finite number"),
        ("{line: 3, shift: soon}", "edits.shift", "must be a valid number, not 'soon'"),
        ("{line: 3, strength: 1.6}", "edits.strength", "must be less than or equal to 1.5"),
        ("{line: 3, strength: -0.1}", "edits.strength", "must be greater than or equal to 0"),
        ("{line: 3, strength: true}", "edits.strength", "must be a valid number, not True"),
        ("{line: 3, keys: [{at: 0.1}]}", "edits.keys.strength", "is required"),
        ("{line: 3, keys: [{at: -1, strength: 0}]}", "edits.keys.at", "greater than or equal"),
        ("{line: 3, keys: [{at: 9, strength: 0}]}", "edits.keys.at", "ends after"),
        ("{line: 3, keys: 4}", "edits.keys", "must be"),
        ("{line: 3, film_mouth: [{start: 1}]}", "edits.film_mouth.end", "is required"),
        ("{line: 3, film_mouth: [{start: 9, end: 10}]}", "edits.film_mouth.start", "ends after"),
        (
            "{line: 3, film_mouth: [{start: 0.4, end: 0.2}]}",
            "edits.film_mouth",
            "ends at 0.2 s, and begins at 0.4 s",
        ),
        ("{line: 3, moved: [{start: 0.1, end: 0.2}]}", "edits.moved.shift", "is required"),
        ("{line: 3, style: soft}", "edits.style", "must be one of 'as spoken', 'softer'"),
        ("{line: 3, mvoed: []}", "edits.mvoed", "unknown key; did you mean 'moved'?"),
        ("{line: 3, moved: [{start: 9, end: 10, shift: 9}]}", "edits.moved.start", "ends after"),
        (
            "{line: 3, moved: [{start: 0.3, end: 1, shift: 9}, {start: 0.1, end: 0.4, shift: 9}]}",
            "edits.moved",
            "the parts from 0.1 and from 0.3 s overlap",
        ),
        ("{line: 3, take: wid, takes: {wide: {}}}", "edits.take", "mean 'wide'?"),
        ("{line: 3, take: a, takes: {bc: {}, de: {}}}", "edits.take", "there is bc, de"),
        ("{line: 3, take: a}", "edits.take", "has no take 'a': write it into takes"),
        ("{line: 3, takes: {a: {strength: 2}}}", "edits.takes.a.strength", "less than or equal"),
        (
            "{line: 3, take: a, takes: {a: {keys: [{at: 9, strength: 0}]}}}",
            "edits.takes.a.keys.at",
            "ends",
        ),
        ("[{line: 3}, {line: 1, strenght: 0}]", "edits[1].strenght", "mean 'strength'?"),
        ("{line: 3, strenght: 0}", "edits.strenght", "unknown key; did you mean 'strength'?"),
        ("{line: three}", "edits.line", "must be a valid integer, not 'three'"),
        ("[3]", "edits[0]", "must hold keys, not 3"),
        ("soft", "edits", "must hold keys, not text"),
        ("{shift: 80}", "edits.line", "is required: which line of the scene; there is 1, 3"),
        ("{line: 7}", "edits.line", "nobody dubs a line 7; there is 1, 3"),
        ("{line: 2}", "edits.line", "a line 2 (CAT is not in speakers); there is 1, 3"),
        ("{line: 3, speaker: BEN}", "edits.speaker", "does not speak line 3; it is of ANN"),
        ("[{line: 3}, {line: 3}]", "edits[1]", "line 3 has an edit already: write both into one"),
    ],
)
def test_a_mistake_is_said_with_its_place(folder: Path, text: str, key: str, words: str) -> None:
    (problem,) = problems(scene(folder, text))
    assert problem.startswith("line 9: "), problem
    assert f"dubs[0].{key}: " in problem
    assert words in problem


def test_lines_of_one_number_are_to_be_numbered_anew(folder: Path) -> None:
    (problem,) = problems(scene(folder, "{line: 1}", SCENE.replace("it.srt", "twice.srt")))
    assert "2 lines have the number 1: number them anew" in problem


def test_a_mistake_stands_on_its_own_line_of_the_file(folder: Path) -> None:
    path = scene(folder, "\n     {line: 3,\n      shfit: 3}")
    assert problems(path)[0].startswith("line 11: dubs[0].edits.shfit: ")


@pytest.mark.parametrize(
    ("who", "text", "why"),
    [
        ("old", "{keys: [{at: 0, strength: 0.5}]}", "preset 'paper' of old has no lip measures"),
        ("old", "{strength: 0.5}", "preset 'paper' of old has no lip measures"),
        ("mute", "{strength: 0}", "preset 'nerf' of mute has no lip measures"),
        ("old", "{curves: track.wav}", "preset 'paper' of old has no lip measures"),
        ("mute", "{shift: 40}", "preset 'nerf' of mute hears no speech"),
        ("old", "{shift: 40, strength: 1}", ""),
    ],
)
def test_a_model_that_cannot_be_edited_so(folder: Path, who: str, text: str, why: str) -> None:
    path = written(folder, ALONE.replace("WHO", who).replace("EDITS", text))
    if not why:
        assert edits(path) == [Edit(shift=40)]
        return
    (problem,) = problems(path)
    assert f"{why}: leave it out, or take preset 'fast'" in problem


def test_of_somebody_unknown_only_that_is_said(folder: Path) -> None:
    lines = SCENE.replace("{ANN: ann}", "{ANN: anna}")
    (problem,) = problems(scene(folder, "{line: 3, strength: 0}", lines))
    assert "no identity 'anna'" in problem


@pytest.fixture
def own(folder: Path) -> Iterator[Path]:
    """The file of edits of the dub `it`."""
    path = edits_file.edits_file(folder / "m.yaml", "it")
    yield path
    path.unlink()


def test_edits_can_lie_in_a_file_beside_the_manifest(folder: Path, own: Path) -> None:
    own.write_text("- line: 3\n  shift: -40\n  status: redo\n")
    assert edits(written(folder, f"{{{SCENE}}}")) == [Edit(), Edit(shift=-40, status="redo")]
    own.write_text("{line: 1, strength: 0}\n")
    assert edits(written(folder, f"{{{SCENE}}}"))[0] == Edit(strength=0)
    own.write_text("# nothing yet\n")
    assert edits(written(folder, f"{{{SCENE}}}")) == [Edit(), Edit()]


def test_edits_in_both_places_are_refused(folder: Path, own: Path) -> None:
    own.write_text("{line: 3, shift: 80}")
    (problem,) = problems(scene(folder, "{line: 3, shift: 80}"))
    assert "dubs[0].edits: it.edits.yaml holds edits of this dub, too: move all into" in problem


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("- line: 3\n  keys:\n  - at: 9\n    strength: 0", "line 3: [0].keys[0].at: the sound"),
        ("- line: 1\n- line: 3\n  shfit: 3", "line 3: [1].shfit: unknown key; did you mean"),
        ("line: 3\nstatus: done", "line 2: status: must be one of 'open', 'approved' or 'redo'"),
        ("- line: 7", "line 1: [0].line: nobody dubs a line 7; there is 1, 3"),
        ("- line: 3\n  line: 1", "line 2: [0].line: given twice"),
        ("soft", "line 1: must hold keys, not text"),
        ("{", ": line 1: not valid YAML"),
    ],
)
def test_a_mistake_in_that_file_names_it(folder: Path, own: Path, text: str, words: str) -> None:
    own.write_text(text)
    (problem,) = problems(written(folder, f"{{{SCENE}}}"))
    assert problem.startswith("it.edits.yaml"), problem
    assert words in problem


def test_such_a_file_comes_back_as_it_was_written(own: Path) -> None:
    folder = {"folder": own.parent}
    note = 'zwei: "#" é\u0085\n ' + "long " * 50
    keys = [entry.Key(at=0.52, strength=0), entry.Key(at=1.25, strength=1.5)]
    given = [
        entry.Edit(line=3, shift=-40.5, keys=keys, note=note, status="approved"),
        entry.Edit(line=7, speaker="- Ann", strength=0.5),
        entry.Edit(line=1, shift=80),
        entry.Edit.model_validate({"line": 2, "curves": "lips.csv"}, context=folder),
    ]
    edits_file.write(own, given)
    written = edits_file.read(own).data
    assert written[-1] == {"line": 2, "curves": "lips.csv"}
    again = [entry.Edit.model_validate(one, context=folder) for one in written]
    assert again == given
    assert edits_file.text_of(again, own.parent) == own.read_bytes()
    assert "shift: 80}" in own.read_text(encoding="utf-8")


def test_plan_names_edited_lines(folder: Path) -> None:
    path = scene(folder, "[{line: 3, shift: -40, strength: 0.5, note: mumbled}]")
    result = CliRunner().invoke(app, ["plan", str(path)])
    words = "it, line 3 at 00:00:02:00: edited: the mouth 40 ms earlier, strength 0.5: mumbled"
    assert words in result.output, result.output
    assert result.output.count("edited") == 1
    result = CliRunner().invoke(app, ["plan", str(path), "--json"])
    (named,) = json.loads(result.output)["edits"]["it"]
    assert (named["line"], named["shift"], named["strength"]) == (3, -40, 0.5)
