"""The lines of a scene with their times and figures, as three files beside its video."""

import csv
import io
import json
from pathlib import Path
from typing import Any

from dubbing import json_records
from dubbing.engine.graph import Job
from dubbing.errors import DubbingError
from dubbing.manifest.entries import Dub
from dubbing.manifest.manifest import Manifest
from dubbing.script.edl import Marker, edl
from dubbing.stages.kinds import PICTURE_FILE, SCENE_FILE, SYNC_FILE

FORMULA = tuple("=+-@|%\uff1d\uff0b\uff0d\uff20")  # what a formula begins with, in wide signs, too
COLOURS = {"pass": "green", "warn": "yellow", "fail": "red", "unjudged": "blue"}
OF_SOUND = ("loudness", "true_peak", "gain")
OF_SYNC = ("verdict", "reason", "offset_frames", "confidence")


def lines_of(manifest: Manifest, dub: Dub, job: Job) -> list[dict[str, Any]]:
    """The lines of a scene in the order of their times; none where it is no scene.

    What was not measured is None.
    """
    scene = manifest.scenes.get(dub.name)
    if scene is None or dub.lines is None or "check" not in job.stages:
        return []
    film = manifest.media[scene.clip]
    sound, picture = scene_of(job).get("sound") or {}, picture_of(job)
    heard = {figures["cue"]: figures for figures in sound.get("cues", [])}
    judged = {
        (round(part["start"] * film.rate), round(part["end"] * film.rate)): part
        for part in _read(job, "check", SYNC_FILE).get("segments") or []
    }
    rows = []
    for cue in scene.cues:
        frames = (cue.first, cue.stop)
        sync, own = judged.get(frames, {}), heard.get(cue.name, {})
        offset = sync.get("offset_frames")
        kept, over = (
            [part for part in picture.get(name) or [] if part["cue"] == cue.name]
            for name in ("own_pixels", "overlaid")
        )
        rows.append(
            {
                "line": cue.number,
                "speaker": cue.speaker,
                "identity": cue.identity,
                "in": film.timecode_at(cue.first),
                "out": film.timecode_at(cue.stop),
                "in_frame": cue.first,
                "out_frame": cue.stop,
                "seconds": round(float(cue.first / film.rate), 3),
                **{key: sync.get(key) for key in OF_SYNC},
                "offset_ms": None if offset is None else round(float(1000 * offset / film.rate), 1),
                **{key: own.get(key) for key in OF_SOUND},
                "own_pixels_frames": sum(part["stop"] - part["first"] for part in kept),
                "own_pixels": "; ".join(
                    f"{part['reason']} {part['first']}-{part['stop']}" for part in kept
                ),
                "overlaid": "; ".join(f"{part['first']}-{part['stop']}" for part in over),
                "words": cue.words,
            }
        )
    return rows


def undubbed_of(manifest: Manifest, name: str) -> list[dict[str, Any]]:
    """The lines of a dub's film that nobody dubs, in the order of their times, and why not."""
    scene = manifest.scenes.get(name)
    if scene is None:
        return []
    film = manifest.media[scene.clip]
    return [
        {
            "line": line.number,
            "in": film.timecode_at(line.first),
            "out": film.timecode_at(line.stop),
            "seconds": round(float(line.first / film.rate), 3),
            "speaker": line.speaker,
            "words": line.words,
            "why": line.why,
        }
        for line in sorted(scene.undubbed, key=lambda line: line.first)
    ]


def picture_of(job: Job) -> dict[str, Any]:
    """Record of a composite about its faces and its invisible mark; empty without one."""
    return _read(job, "composite", PICTURE_FILE)


def scene_of(job: Job) -> dict[str, Any]:
    """What a scene's composite recorded of its sound and of untouched frames; else empty."""
    return _read(job, "composite", SCENE_FILE)


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


def as_edl(manifest: Manifest, dub: Dub, rows: list[dict[str, Any]]) -> str:
    """A marker a line, coloured by its verdict, and one where the film's own face is kept."""
    film = manifest.media[manifest.scenes[dub.name].clip]
    markers = [
        Marker(row["in_frame"], row["out_frame"], COLOURS.get(row["verdict"], "blue"), _note(row))
        for row in rows
    ]
    for row in rows:
        for part in filter(None, row["own_pixels"].split("; ")):
            reason, _, frames = part.rpartition(" ")
            first, stop = map(int, frames.split("-"))
            note = f"{row['line']} {_who(row)} {reason}: the film's own face"
            markers.append(Marker(first, stop, "cyan", note))
    markers.sort(key=lambda marker: marker.first)
    return edl(dub.name, markers, film.timecode_at, drop=film.drops)


def _note(row: dict[str, Any]) -> str:
    return f"{row['line']} {_who(row)} {row['verdict'] or 'not checked'}: {row['words']}"


def _who(row: dict[str, Any]) -> str:
    return str(row["speaker"] or row["identity"])


def _read(job: Job, stage: str, name: str) -> dict[str, Any]:
    """A file of a stage; empty where there is none that can be read."""
    try:
        path: Path = job.stages[stage].folder / name
        return json_records.read(path, dict[str, Any], name)
    except (DubbingError, KeyError):
        return {}
