"""The dubs of a manifest as the page shows them, and the edits of their lines.

F frames of a dub.
"""

import hashlib
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from pydantic import ValidationError

from dubbing.batch.curves import check_made
from dubbing.batch.jobs import build
from dubbing.engine import planner
from dubbing.engine.file_digests import digest_of
from dubbing.engine.graph import Jobs
from dubbing.errors import ExplainedError
from dubbing.manifest import edit_entry, edits_file, yaml_lines
from dubbing.manifest.edits import edits_of
from dubbing.manifest.findings import Findings, Scene
from dubbing.manifest.messages import plain
from dubbing.pipeline import DUB
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.report.lines import lines_of
from dubbing.script.timeline import Cue, Edit
from dubbing.stages.draft import Draft

OF_LINE = ("line", "speaker", "identity", "in", "verdict", "reason", "words")


class StaleError(ExplainedError):
    """Edits were saved by somebody else in the meantime."""


class Project:
    """The dubs of a manifest. Edits lie in files alone, so that several pages see the same.

    Attributes:
        dubs: by name, those that can be drafted.
        lacking: by name, why others cannot.
    """

    def __init__(self, production: Production) -> None:
        self.production = production
        self._saving = Lock()
        self.lacking: dict[str, str] = {}
        drafts = build(production, draft=True).named(DUB)
        for name, job in drafts.items():
            self.lacking |= {name: str(why)} if (why := production.dubs[name].blocked) else {}
            for draft in job.all_of(Draft):
                try:
                    check_made(production, name, draft)
                except ExplainedError as error:
                    self.lacking[name] = str(error)
        self.dubs = {n: d for n, d in production.dubs.items() if n not in self.lacking}

    @cached_property
    def _jobs(self) -> Jobs:
        return build(self.production)

    def stale(self) -> list[str]:
        """Stages that were made from other inputs, or by another version, than is there now."""
        drafts = build(self.production, draft=True)
        rows = [row for row in planner.rows(drafts) if not isinstance(row.stage, Draft)]
        return [f"{r.job.name}: {r.name}" for r in rows if r.state not in (planner.UP_TO_DATE,)]

    def revision(self, name: str) -> str:
        """Which content the edits of a dub have."""
        return self._read(name)[0]

    def edits(self, name: str) -> dict[str, Edit]:
        """The edits of a dub by the names of its cues; as spoken for the others.

        Raises:
            ExplainedError: its file holds something else.
        """
        dub = self.dubs[name]
        if dub.fixed_edits:
            return {cue.name: cue.edit for cue in dub.cues}
        found = self._checked(dub, self._read(name)[1])
        return {cue.name: found.get(cue.name, Edit()) for cue in dub.cues}

    def save(self, name: str, cue: Cue, revision: str, given: Any) -> str:
        """Put the edit of a cue, as JSON holds it, into the file; gives the new revision.

        Raises:
            StaleError: the file is of another revision.
            ExplainedError: it is no such edit, or cannot be written.
        """
        dub = self.dubs[name]
        if dub.fixed_edits:
            own = edits_file.edits_file(self.production.manifest, name).name
            what = f"the manifest holds the edits of {name}"
            raise ExplainedError(what, remedy=f"move them to {own} beside it")
        with self._saving:
            now, edits = self._read(name)
            if revision != now:
                raise StaleError("saved elsewhere in the meantime", remedy="look, then do it again")
            ids = {one: place for place, one in enumerate(dub.cues)}
            rest = {self._cue(dub, one): one for one in edits}
            rest[cue] = self._entry(dub, cue, given, rest.get(cue))
            kept = sorted(rest, key=lambda one: ids[one])
            plain_edit = edit_entry.Edit(**_line(dub, cue))
            new = [rest[one] for one in kept if one != cue or rest[one] != plain_edit]
            self._checked(dub, new)
            edits_file.write(edits_file.edits_file(self.production.manifest, name), new)
            return self._read(name)[0]

    def shown(self, name: str) -> dict[str, Any]:
        """A dub with its lines, as the page gets them."""
        dub, edits = self.dubs[name], self.edits(name)
        rows = lines_of(dub, self._jobs.named(DUB)[name])
        video = self.video(name)
        return {
            "name": name,
            "rate": float(dub.film.rate),
            "frames": dub.length,
            "size": [side // 2 for side in (dub.info.width, dub.info.height)],
            "revision": self.revision(name),
            "fixed": dub.fixed_edits,
            "dubbed": video is not None,
            "lines": [
                {key: row[key] for key in OF_LINE}
                | {"cue": cue.name, "first": cue.first, "stop": min(cue.stop, dub.length)}
                | {"seconds": cue.seconds, "edit": _as_json(edits[cue.name])}
                | {"strengths": self._strengths(dub, cue, edits[cue.name]).round(4).tolist()}
                for row, cue in zip(rows, dub.cues, strict=True)
            ],
        }

    def video(self, name: str) -> Any:
        """The finished video of a dub; None before it is made."""
        dub = self.dubs[name]
        path = self.production.output / dub.results()["video"]
        return path if path.is_file() else None

    def signatures(self, name: str, kind: str, first: int, stop: int) -> list[str]:
        """Of frames first .. stop: as long as one stays the same, so does its picture."""
        if kind == "source":
            return ["-"] * (stop - first)
        if kind == "dub":
            video = self.video(name)
            return [str(video.stat().st_mtime_ns if video else 0)] * (stop - first)
        dub, edits = self.dubs[name], self.edits(name)
        parts: list[str] = [""] * dub.length
        for cue in dub.cues:
            edit = edits[cue.name]
            for k, share in enumerate(self._strengths(dub, cue, edit), cue.first):
                parts[k] += f"{edit.shift:g}/{share:.4f}/{_digest(edit)} "
        return parts[first:stop]

    def _strengths(self, dub: Dub, cue: Cue, edit: Edit) -> np.ndarray:
        return edit.strengths(min(cue.stop, dub.length) - cue.first, dub.film.rate)

    def _read(self, name: str) -> tuple[str, list[edit_entry.Edit]]:
        """Revision and content of a dub's file of edits."""
        path = edits_file.edits_file(self.production.manifest, name)
        document = edits_file.read(path) if path.exists() else yaml_lines.Document([])
        content = path.read_bytes() if path.exists() else b""
        revision = hashlib.sha256(content).hexdigest()[:16]
        if document.problems:
            raise ExplainedError(str(document.problems[0]), path.name, "mend the file")
        data = document.data if isinstance(document.data, list) else [document.data]
        return revision, [_validated(one, path.name, path.parent) for one in data]

    def _entry(
        self, dub: Dub, cue: Cue, given: Any, before: edit_entry.Edit | None
    ) -> edit_entry.Edit:
        if not isinstance(given, dict) or {"line", "speaker"} & {*given}:
            raise ExplainedError("an edit is an object without line and speaker")
        curves = before.curves if before else None
        if given.get("curves") not in (None, str(curves)):  # no page may have other files read
            raise ExplainedError("curves: only those in the file stay", remedy="name others there")
        return _validated(_line(dub, cue) | given, "", self.production.manifest.parent)

    def _cue(self, dub: Dub, edit: edit_entry.Edit) -> Cue:
        """The cue of an edit in the file."""
        name = next(iter(self._checked(dub, [edit])))
        return next(cue for cue in dub.cues if cue.name == name)

    def _checked(self, dub: Dub, edits: list[edit_entry.Edit]) -> Mapping[str, Edit]:
        findings = Findings()
        scene = Scene(
            dub.film.path, dub.cues, undubbed=dub.undubbed, film_heard=dub.sound.film_heard
        )
        presets = {person.name: person.settings.preset for person in dub.people}
        found = edits_of(findings, (), edits, scene, presets)
        if findings.problems:
            key, message = findings.problems[0]
            raise ExplainedError(f"{yaml_lines.key_path(key[1:])}: {message}".lstrip(": "))
        return found


def _line(dub: Dub, cue: Cue) -> dict[str, Any]:
    """The keys that say which line an edit is of."""
    several = sum(one.number == cue.number for one in dub.cues) > 1
    return {"line": cue.number} | ({"speaker": cue.speaker} if several else {})


def _digest(edit: Edit) -> str:
    """Of the curves of an edit."""
    return digest_of(edit.curves[0])[:8] if edit.curves else ""


def _validated(given: Any, where: str, folder: Path) -> edit_entry.Edit:
    try:
        return edit_entry.Edit.model_validate(given, context={"folder": folder})
    except ValidationError as error:
        detail = error.errors()[0]
        key = yaml_lines.key_path(tuple(detail["loc"]))
        message = plain(detail, edit_entry.Edit)
        raise ExplainedError(f"{key}: {message}" if key else message, where) from None


def _as_json(edit: Edit) -> dict[str, Any]:
    keys = [{"at": at, "strength": strength} for at, strength in edit.keys]
    curves = str(edit.curves[0]) if edit.curves else None
    return {**vars(edit), "keys": keys, "curves": curves}
