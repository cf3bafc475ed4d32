"""Notes that were written on the page of a report, on their way back into the files of edits."""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import digest_data
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.kept_edits import KeptEdits
from dubbing.manifest.keys.edit_entry import LONGEST_NOTE, Edit
from dubbing.manifest.keys.messages import suggestion
from dubbing.production.production import Production
from dubbing.script.timeline import Cue

ANEW = "make the report anew, and write the notes there"


class Note(BaseModel):
    """A decision about a line, and a digest that tells whether the line is still the same.

    Attributes:
        cue: see `Cue.name`. told: see `told`.
        at: its first timecode.
    """

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    dub: str
    line: int
    cue: str
    told: str
    at: str = Field(alias="in")
    note: str = Field(max_length=LONGEST_NOTE)
    status: Literal["open", "approved", "redo"]


class Notes(BaseModel):
    """Such a file."""

    dfrf_notes: Literal[1]
    manifest: str
    notes: list[Note]


def told(cue: Cue) -> str:
    """A digest of what a line says, by which its notes know it again."""
    return digest_data([cue.number, cue.speaker, cue.words])[:16]


def read(path: Path) -> list[Note]:
    """The notes in a file.

    Raises:
        ExplainedError: it holds something else.
    """
    remedy = "give the file that the page of a report wrote"
    return json_records.read(path, Notes, "a file of notes", remedy).notes


def put(production: Production, path: Path) -> dict[str, list[Note]]:
    """Write the notes of a file into the edits of its dubs, all or none; gives them by dub.

    Raises:
        ExplainedError: a note is of no line of this manifest, or cannot be written.
    """
    by_dub: dict[str, list[Note]] = {}
    for note in read(path):
        by_dub.setdefault(note.dub, []).append(note)
    ready: list[tuple[KeptEdits, dict[Cue, Edit], dict[Cue, Note]]] = []
    for name, notes in by_dub.items():
        if name not in production.dubs:
            what = f"{production.manifest.name} has no dub {name!r:.100}"
            close = suggestion(name, list(production.dubs)) or ""
            raise ExplainedError(what + close, path.name, "give the manifest of that report")
        kept = KeptEdits(production.manifest, production.dubs[name])
        _, entries = kept.entries()
        found = {_cue(kept, note, path): note for note in notes}
        for cue, note in found.items():
            before = entries.get(cue, kept.plain(cue))
            decided = {"note": note.note, "status": note.status}
            entries[cue] = before.model_copy(update=decided)
        ready.append((kept, entries, found))
    for kept, entries, found in ready:
        kept.put(entries, found)
    return by_dub


def _cue(kept: KeptEdits, note: Note, path: Path) -> Cue:
    """The cue that a note is of."""
    which = f"line {note.line} of {note.dub}, at {note.at}"
    for cue in kept.dub.cues:
        if cue.name == note.cue:
            if told(cue) != note.told:
                raise ExplainedError(f"{which}: its words changed since", path.name, ANEW)
            return cue
    raise ExplainedError(f"{which}: no such line, or its times changed since", path.name, ANEW)
