"""Figures of the takes of lines: of those that were made, also where another is chosen now."""

from typing import Any

from dubbing.engine.disk import json_records
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import atomic_write_json, digest_data
from dubbing.engine.graph.graph import Job
from dubbing.production.dub import Dub
from dubbing.script.edit import Edit
from dubbing.script.timeline import TAKES, Cue

FIGURES = "figures.json"  # beside what was rendered of a take
KEPT = ("verdict", "reason", "offset_ms", "confidence", "closeness", "dubbed")


def keep(dub: Dub, job: Job, rows: list[dict[str, Any]]) -> None:
    """Keep the figures of the chosen takes of a finished dub, by the rows of its lines."""
    for cue, row in zip(dub.cues, rows, strict=True):
        if cue.edit.takes:
            found = {key: row[key] for key in KEPT} | {"line": _line(cue), "of": _digest(cue.edit)}
            atomic_write_json(job.folder / job.parts / cue.taken / FIGURES, found)


def takes_of(job: Job, cue: Cue, edit: Edit) -> list[dict[str, Any]]:
    """The takes of an edit of a cue, with figures where one was made as it is now.

    A take with another recording may give a dub without lines another length, and so its cue
    another name: its figures are known by their line.
    """
    folders = (job.folder / job.parts).glob
    files = [file for at in ("*", f"*/{TAKES}/*") for file in folders(f"{at}/{FIGURES}")]
    kept = [json_records.read_or({}, file, dict[str, Any]) for file in files]
    known = {one["of"]: one for one in kept if one.get("line") == _line(cue)}
    found = []
    for name, version in edit.takes:
        figures = known.get(_digest(version), {})
        one: dict[str, Any] = {"take": name, "edit": version.in_words(), "made": bool(figures)}
        found.append(one | {key: figures.get(key) for key in KEPT})
    return found


def _line(cue: Cue) -> list[Any]:
    return [cue.identity, cue.number, cue.speaker]


def _digest(edit: Edit) -> str:
    """Of a take: its name, its recording, and its edit."""
    files = [edit.audio, edit.curves and edit.curves[0]]
    plain = [edit.take, edit.shift, edit.strength, edit.keys, edit.film_mouth]
    plain += [edit.moved, edit.style]
    return digest_data([plain, [digest_of(file) if file else "" for file in files]])
