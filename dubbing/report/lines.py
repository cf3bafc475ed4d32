"""The lines of a dub with their times and figures, as three files beside its video."""

import csv
import io
import json
from collections.abc import Callable
from typing import Any, TypeVar

from typing_extensions import TypedDict

from dubbing.engine.disk import json_records
from dubbing.engine.graph.graph import Job
from dubbing.engine.graph.stage import Stage
from dubbing.errors import ExplainedError
from dubbing.preparation.tracking.reach import Reach
from dubbing.production.dub import Dub
from dubbing.script.edit import AS_SPOKEN, Edit
from dubbing.script.edl import Marker, edl
from dubbing.script.timeline import Cue
from dubbing.stages.check import Check
from dubbing.stages.composite import Composite
from dubbing.sync.records import SYNC_FILE
from dubbing.video.files import PICTURE_FILE, SCENE_FILE
from dubbing.video.own_pixels import OwnPixels

FORMULA = tuple("=+-@|%\uff1d\uff0b\uff0d\uff20")  # what a formula begins with, in wide signs, too
COLOURS = {"pass": "green", "warn": "yellow", "fail": "red", "unjudged": "blue"}
OF_SOUND = ("loudness", "true_peak", "gain")
OF_SYNC = ("verdict", "reason", "offset_frames", "confidence", "closeness")

Shape = TypeVar("Shape")


class Picture(TypedDict, total=False):
    """Record of a composite about its faces and its invisible mark."""

    own_pixels: list[OwnPixels]
    overlaid: list[OwnPixels]
    reach: dict[str, Reach]
    mark: dict[str, Any]
    delivered: dict[str, Any]


def lines_of(dub: Dub, job: Job) -> list[dict[str, Any]]:
    """The lines of a dub in the order of their times; none of one that is blocked.

    Figures that were not measured are None.
    """
    sound, picture = scene_of(job).get("sound") or {}, picture_of(job)
    figures_of = {figures["cue"]: figures for figures in sound.get("cues", [])}
    check: dict[str, Any] = _read(job, Check, SYNC_FILE, dict[str, Any])
    reach = picture.get("reach", {})
    rows = []
    for cue in dub.cues:
        rate, own = dub.film.rate, figures_of.get(cue.name, {})
        sync = _judged(check, dub, cue)
        offset = sync.get("offset_frames")
        kept, over = (
            [part for part in parts if part["cue"] == cue.name]
            for parts in (picture.get("own_pixels", []), picture.get("overlaid", []))
        )
        rows.append(
            {
                "line": cue.number,
                "speaker": cue.speaker,
                "identity": cue.identity,
                "in": dub.timecode(cue.first),
                "out": dub.timecode(cue.stop),
                "in_frame": cue.first,
                "out_frame": cue.stop,
                "seconds": round(float(cue.first / rate), 3),
                **{key: sync.get(key) for key in OF_SYNC},
                "offset_ms": None if offset is None else round(float(1000 * offset / rate), 1),
                **{key: own.get(key) for key in OF_SOUND},
                **reach_columns(reach.get(cue.name)),
                "own_pixels_frames": sum(part["stop"] - part["first"] for part in kept),
                "own_pixels": "; ".join(in_frames(kept)),
                "overlaid": "; ".join(f"{part['first']}-{part['stop']}" for part in over),
                **edit_columns(cue.edit),
                "words": cue.words,
            }
        )
    return rows


def in_frames(parts: list[OwnPixels]) -> list[str]:
    """Runs of frames with their reasons, in words."""
    return [f"{part['reason']} {part['first']}-{part['stop']}" for part in parts]


def reach_columns(reach: Reach | None) -> dict[str, Any]:
    """How much of a line is dubbed, as columns of a table."""
    return {
        "dubbed": reach and round(reach.share, 3),
        "yaw": reach and reach.turned(),
        "pitch": reach and reach.tilted(),
        "reasons": reach and reach.why_not(),
    }


def edit_columns(edit: Edit) -> dict[str, Any]:
    """The edit of a line, as columns of a table; nothing in those that it leaves as spoken."""
    strength = None if edit.strength == 1 else edit.strength
    keys = ", ".join(f"{at:g}: {value:g}" for at, value in edit.keys)
    curves = edit.curves[0].name if edit.curves else ""
    take = {"take": edit.take, "recording": edit.audio.name if edit.audio else ""}
    own = {"shift": edit.shift or None, "strength": strength, "keys": keys, "curves": curves}
    own["film_mouth"] = ", ".join(f"{start:g}-{end:g}" for start, end in edit.film_mouth)
    own["style"] = "" if edit.style == AS_SPOKEN else edit.style
    own["moved"] = ", ".join(f"{start:g}-{end:g}: {by:g}" for start, end, by in edit.moved)
    return {**take, **own, "note": edit.note, "status": edit.status}


def edits_of(dub: Dub) -> list[dict[str, Any]]:
    """The edited lines of a dub, in the order of their times."""
    return [
        {"line": cue.number, "in": dub.timecode(cue.first), "speaker": cue.speaker}
        | edit_columns(cue.edit)
        | {"edit": cue.edit.in_words()}
        for cue in dub.cues
        if cue.edit.in_words()
    ]


def _judged(check: dict[str, Any], dub: Dub, cue: Cue) -> dict[str, Any]:
    """The sync check of a cue: of the whole dub, where the cue is all of it."""
    if len(dub.cues) == 1 and (cue.first, min(cue.stop, dub.length)) == (0, dub.length):
        return check
    rate = dub.film.rate
    for part in check.get("segments") or []:
        if (round(part["start"] * rate), round(part["end"] * rate)) == (cue.first, cue.stop):
            return dict(part)
    return {}


def undubbed_of(dub: Dub) -> list[dict[str, Any]]:
    """The lines of a dub's film that nobody dubs, in the order of their times, and why not."""
    return [
        {
            "line": line.number,
            "in": dub.timecode(line.first),
            "out": dub.timecode(line.stop),
            "seconds": round(float(line.first / dub.film.rate), 3),
            "speaker": line.speaker,
            "words": line.words,
            "why": line.why,
        }
        for line in sorted(dub.undubbed, key=lambda line: line.first)
    ]


def picture_of(job: Job) -> Picture:
    """Record of a composite about its faces and its invisible mark; empty without one."""
    return _read(job, Composite, PICTURE_FILE, Picture)


def scene_of(job: Job) -> dict[str, Any]:
    """Record of a composite about its mixed sound and untouched frames; empty without one."""
    return _read(job, Composite, SCENE_FILE, dict[str, Any])


def as_csv(rows: list[dict[str, Any]]) -> str:
    """A table with a row a line."""
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows({key: _harmless(cell) for key, cell in row.items()} for row in rows)
    return text.getvalue()


def _harmless(cell: Any) -> Any:
    """A cell that no spreadsheet takes for a formula: words may begin as one."""
    formula = isinstance(cell, str) and cell.lstrip()[:1] in FORMULA
    return f"'{cell}" if formula and cell.strip() else cell


def as_json_lines(rows: list[dict[str, Any]]) -> str:
    """An object a line."""
    return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows)


def as_edl(dub: Dub, job: Job, rows: list[dict[str, Any]]) -> str:
    """The markers of a dub as an EDL."""
    return edl(dub.name, markers_of(dub, job, rows), dub.timecode, drop=dub.info.drops)


def markers_of(dub: Dub, job: Job, rows: list[dict[str, Any]]) -> list[Marker]:
    """A marker a line, coloured by its verdict, and one where the film's own face is kept."""
    markers = [
        Marker(row["in_frame"], row["out_frame"], COLOURS.get(row["verdict"], "blue"), _note(row))
        for row in rows
    ]
    by_cue = {cue.name: row for cue, row in zip(dub.cues, rows, strict=True)}
    for part in picture_of(job).get("own_pixels", []):
        row = by_cue[part["cue"]]
        note = f"{row['line']} {_who(row)} {part['reason']}: the film's own face"
        markers.append(Marker(part["first"], part["stop"], "cyan", note))
    return sorted(markers, key=lambda marker: marker.first)


def _note(row: dict[str, Any]) -> str:
    return f"{row['line']} {_who(row)} {row['verdict'] or 'not checked'}: {row['words']}"


def _who(row: dict[str, Any]) -> str:
    return str(row["speaker"] or row["identity"])


def _read(job: Job, kind: type[Stage], name: str, shape: Callable[..., Shape]) -> Shape:
    """A file of a stage; empty where there is none that can be read."""
    try:
        return json_records.read(job.stage(kind).folder / name, shape, name)
    except (ExplainedError, KeyError):
        return shape()
