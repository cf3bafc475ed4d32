"""Notes of a report come back into the file of edits, and no others do."""

import json
from pathlib import Path
from typing import Any

import pytest

from dubbing.cli.page_commands import notes as command
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.edits.notes import put, told
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from tests.dubbing.studio.stand_in import write_scene


@pytest.fixture
def production(tmp_path: Path) -> Production:
    return load(write_scene(tmp_path))


def written(production: Production, **other: Any) -> Path:
    """A file of one note, about the second line of the first dub."""
    name, dub = next(iter(production.dubs.items()))
    cue = dub.cues[1]
    note = {
        "dub": name,
        "line": cue.number,
        "cue": cue.name,
        "told": told(cue),
        "in": "00:00:01:15",
    }
    note |= {"note": "0:01.20: too wide", "status": "redo"} | other
    path = production.manifest.with_name("m.notes.json")
    path.write_text(json.dumps({"dfrf_notes": 1, "manifest": "m.yaml", "notes": [note]}))
    return path


def kept(production: Production) -> Any:
    path = edits_file(production.manifest, next(iter(production.dubs)))
    return yaml_lines.read(path.read_text()).data if path.exists() else None


def test_a_note_joins_the_edit_of_its_line(
    production: Production, capsys: pytest.CaptureFixture[str]
) -> None:
    dub = next(iter(production.dubs.values()))
    first, second = dub.cues[:2]
    before = f"- {{line: {first.number}, shift: 40}}\n- {{line: {second.number}, strength: 0.5}}\n"
    path = edits_file(production.manifest, dub.name)
    path.write_text(before)
    command(written(production), production.manifest)
    assert capsys.readouterr().out == f"{path.name}: 1 line, 1 to redo\n"
    decided = {"strength": 0.5, "note": "0:01.20: too wide", "status": "redo"}
    assert kept(production) == [
        {"line": first.number, "shift": 40},
        {"line": second.number, **decided},
    ]
    again = load(production.manifest).dubs[dub.name].cues[1].edit
    assert (again.note, again.status, again.strength) == (*list(decided.values())[1:], 0.5)


def test_what_is_taken_back_leaves_nothing(production: Production) -> None:
    put(production, written(production))
    assert kept(production)
    put(production, written(production, note="", status="open"))
    assert kept(production) is None


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"dub": "sc"}, "has no dub 'sc'"),
        ({"cue": "ann_0000001-0000002"}, "no such line, or its times changed since"),
        ({"told": "0" * 16}, "its words changed since"),
        ({"status": "done"}, "notes.0.status"),
        ({"note": "x" * 1001}, "notes.0.note"),
        ({"strength": 2}, "notes.0.strength"),
    ],
)
def test_what_does_not_fit_is_refused(
    production: Production, other: dict[str, Any], words: str
) -> None:
    with pytest.raises(ExplainedError, match=words):
        put(production, written(production, **other))
    assert kept(production) is None


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"dfrf_notes": 2, "manifest": "", "notes": []}'])
def test_other_files_are_refused(production: Production, text: str) -> None:
    path = production.manifest.with_name("other.json")
    path.write_text(text)
    with pytest.raises(ExplainedError, match="a file of notes holds something else"):
        put(production, path)


def test_edits_in_the_manifest_are_left_alone(production: Production) -> None:
    text = production.manifest.read_text()
    production.manifest.write_text(text.replace("name: it,", "name: it, edits: [],"))
    again = load(production.manifest)
    with pytest.raises(ExplainedError, match="the manifest holds the edits"):
        put(again, written(again))
