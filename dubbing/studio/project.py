"""The dubs of a manifest as the page shows them, and the edits of their lines.

F frames of a dub.
"""

from collections.abc import Mapping
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np

from dubbing.batch.curves import check_made
from dubbing.batch.jobs import build
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.graph.graph import Jobs
from dubbing.engine.planning import planner
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.kept_edits import KeptEdits, StaleError, validated
from dubbing.manifest.keys import edit_entry
from dubbing.pipeline import DUB
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.report.lines import lines_of
from dubbing.script.timeline import Cue, Edit
from dubbing.stages.draft import Draft

OF_LINE = ("line", "speaker", "identity", "in", "verdict", "reason", "words")


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
        return self._kept(name).read()[0]

    def edits(self, name: str) -> dict[str, Edit]:
        """The edits of a dub by the names of its cues; as spoken for the others.

        Raises:
            ExplainedError: its file holds something else.
        """
        return self._kept(name).edits()

    def save(self, name: str, cue: Cue, revision: str, given: Any) -> str:
        """Put the edit of a cue, as JSON holds it, into the file; gives the new revision.

        Raises:
            StaleError: the file is of another revision.
            ExplainedError: it is no such edit, or cannot be written.
        """
        kept = self._kept(name)
        with self._saving:
            now, entries = kept.entries()
            if revision != now:
                raise StaleError("saved elsewhere in the meantime", remedy="look, then do it again")
            entries[cue] = self._entry(kept.line(cue), given, entries.get(cue))
            kept.put(entries, {cue: entries[cue]})
            return self.revision(name)

    def shown(self, name: str) -> dict[str, Any]:
        """A dub with its lines, as the page gets them."""
        dub, edits = self.dubs[name], self.edits(name)
        rows = lines_of(dub, self._jobs.named(DUB)[name])
        video = self.video(name)
        takes = {} if dub.fixed_edits else _takes(self._kept(name).entries()[1])
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
                | {"takes": takes.get(cue.name, {"": {}})}
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

    def _kept(self, name: str) -> KeptEdits:
        return KeptEdits(self.production.manifest, self.dubs[name])

    def _entry(
        self, line: dict[str, Any], given: Any, before: edit_entry.Edit | None
    ) -> edit_entry.Edit:
        if not isinstance(given, dict) or {"line", "speaker"} & {*given}:
            raise ExplainedError("an edit is an object without line and speaker")
        versions = given.pop("takes", None) or {}
        if not isinstance(versions, dict) or not all(
            isinstance(v, dict) for v in versions.values()
        ):
            raise ExplainedError("takes are objects by their names")
        versions[str(given.get("take", ""))] = {
            key: given.pop(key) for key in edit_entry.Take.model_fields if key in given
        }
        allowed: set[str | None] = {None}  # no page may have other files read
        if before:
            known = (before.curves, *(take.curves for take in before.takes.values()))
            allowed |= {str(one) for one in known}
        if any(one.get("curves") not in allowed for one in versions.values()):
            raise ExplainedError("curves: only those in the file stay", remedy="name others there")
        given |= versions.pop("", {})
        return validated(line | given | {"takes": versions}, "", self.production.manifest.parent)


def _digest(edit: Edit) -> str:
    """Of the curves of an edit."""
    return digest_of(edit.curves[0])[:8] if edit.curves else ""


def _takes(entries: Mapping[Cue, edit_entry.Edit]) -> dict[str, dict[str, Any]]:
    """By cue, the versions of its edit by their names; the unnamed one is that of the line."""
    kept = set(edit_entry.Take.model_fields)
    return {
        cue.name: {"": entry.model_dump(mode="json", include=kept)}
        | {name: take.model_dump(mode="json") for name, take in entry.takes.items()}
        for cue, entry in entries.items()
    }


def _as_json(edit: Edit) -> dict[str, Any]:
    keys = [{"at": at, "strength": strength} for at, strength in edit.keys]
    curves = str(edit.curves[0]) if edit.curves else None
    return {**vars(edit), "keys": keys, "curves": curves}
