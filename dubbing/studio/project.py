"""The dubs of a manifest as the page shows them, and the edits of their lines.

F frames of a dub.
"""

from collections import Counter
from collections.abc import Mapping
from threading import Lock
from typing import Any

import numpy as np

from dubbing.batch.curves import check_made
from dubbing.batch.jobs import build
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import digest_data
from dubbing.engine.planning import planner
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.kept_edits import KeptEdits, StaleError, validated
from dubbing.manifest.keys import edit_entry
from dubbing.manifest.manifest import load
from dubbing.pipeline import DUB
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.report.lines import lines_of
from dubbing.report.takes import takes_of
from dubbing.script.edit import Edit
from dubbing.script.timeline import FADE, Cue
from dubbing.stages.draft import Draft

REACH = 7  # frames to each side whose speech a head depends on; see `heads.frame_inputs`
OF_LINE = ("line", "speaker", "identity", "in", "verdict", "reason", "words")


class Project:
    """The dubs of a manifest. Edits lie in files alone, so that several pages see the same.

    Attributes:
        dubs: by name, those that can be drafted.
        lacking: by name, why others cannot.
    """

    def __init__(self, production: Production) -> None:
        self._saving, self._loading = Lock(), Lock()
        self._look(production)

    def _look(self, production: Production) -> None:
        """Take a production, whose stages are there or not."""
        self.production = production
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
        self._jobs = build(production)

    def heard(self, name: str) -> str:
        """Names the recordings of a dub."""
        return digest_data([[cue.edit.take, str(cue.audio)] for cue in self.dubs[name].cues])[:16]

    def stale(self) -> list[str]:
        """Stages that were made from other inputs, or by another version, than is there now.

        Recordings that nobody listened to are none: the page has it done.
        """
        rows = planner.rows(build(self.production, draft=True))
        late = [row for row in rows if row.state != planner.UP_TO_DATE]
        late = [row for row in late if not isinstance(row.stage, Draft)]
        made = [row for row in late if row.stage is None or row.stage.record()]
        found = Counter(f"{row.job.name}: {row.name.split()[0]}" for row in made)
        return [name if count == 1 else f"{name}, {count} times" for name, count in found.items()]

    def revision(self, name: str) -> str:
        """Which content the edits of a dub have."""
        return self._kept(name).read()[0]

    def edits(self, name: str) -> dict[str, Edit]:
        """The edits of a dub by the names of its cues; as spoken for the others.

        Where a take with another recording is chosen by now, all is looked at anew.

        Raises:
            ExplainedError: its file holds something else.
        """
        with self._loading:
            found = self._kept(name).edits()
            if any(found[cue.name].audio != cue.edit.audio for cue in self.dubs[name].cues):
                self._look(load(self.production.manifest))
                found = self._kept(name).edits()
            return found

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
        edits, dub, job = self.edits(name), self.dubs[name], self._jobs.named(DUB)[name]
        rows = lines_of(dub, job)
        video = self.video(name)
        takes = {} if dub.fixed_edits else _takes(self._kept(name).entries()[1])
        return {
            "name": name,
            "rate": float(dub.film.rate),
            "frames": dub.length,
            "size": [side // 2 for side in (dub.info.width, dub.info.height)],
            "revision": self.revision(name),
            "heard": self.heard(name),
            "fixed": dub.fixed_edits,
            "dubbed": video is not None,
            "lines": [
                {key: row[key] for key in OF_LINE}
                | {"cue": cue.name, "first": cue.first, "stop": min(cue.stop, dub.length)}
                | {"seconds": cue.seconds, "edit": _as_json(edits[cue.name])}
                | {"takes": takes.get(cue.name, {"": {}})}
                | {
                    "verdicts": {
                        one["take"]: one["verdict"] for one in takes_of(job, cue, edits[cue.name])
                    }
                }
                | {"strengths": self._strengths(dub, cue, edits[cue.name]).round(4).tolist()}
                | {"moments": self._heard(dub, cue, edits[cue.name]).round(4).tolist()}
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
        if kind == "film":
            return ["-"] * (stop - first)
        if kind == "dub":
            video = self.video(name)
            return [str(video.stat().st_mtime_ns if video else 0)] * (stop - first)
        edits, dub = self.edits(name), self.dubs[name]
        parts: list[str] = [""] * dub.length
        for cue in dub.cues:
            edit, curves = edits[cue.name], _digest(edits[cue.name])
            strengths = self._strengths(dub, cue, edit)
            own = np.flatnonzero(edit.of_film(len(strengths), dub.film.rate))
            away = np.abs(np.subtract.outer(np.arange(len(strengths)), own))
            near = (away <= FADE).sum(1)  # beside such frames the face fades in and out
            late = self._heard(dub, cue, Edit()) - self._heard(dub, cue, edit)
            for k, (share, film) in enumerate(zip(strengths, near, strict=True)):
                beside = late[max(0, k - REACH) : k + REACH + 1].round(5).tolist()
                moved = digest_data(beside)[:8] if len({*beside}) > 1 else f"{beside[0]:g}"
                parts[cue.first + k] += f"{moved}/{share:.4f}/{edit.style}/{curves}/{film} "
        return parts[first:stop]

    def _strengths(self, dub: Dub, cue: Cue, edit: Edit) -> np.ndarray:
        return edit.strengths(min(cue.stop, dub.length) - cue.first, dub.film.rate)

    def _heard(self, dub: Dub, cue: Cue, edit: Edit) -> np.ndarray:
        return edit.heard(min(cue.stop, dub.length) - cue.first, dub.film.rate)

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
            known = [before.curves, *(one.curves for one in before.takes.values())]
            allowed |= {str(one) for one in known + [one.audio for one in before.takes.values()]}
        for key in ("curves", "audio"):
            if any(one.get(key) not in allowed for one in versions.values()):
                what = f"{key}: only those in the file stay"
                raise ExplainedError(what, remedy="name others there")
        given |= {key: value for key, value in versions.pop("", {}).items() if key != "audio"}
        return validated(line | given | {"takes": versions}, "", self.production.manifest.parent)


def _digest(edit: Edit) -> str:
    """Of the curves and of the recording of an edit."""
    files = (edit.curves and edit.curves[0], edit.audio)
    return "/".join(digest_of(file)[:8] if file else "" for file in files)


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
    spans = [{"start": start, "end": end} for start, end in edit.film_mouth]
    audio = str(edit.audio) if edit.audio else None
    moved = [{"start": start, "end": end, "shift": by} for start, end, by in edit.moved]
    own = {"keys": keys, "curves": curves, "film_mouth": spans, "audio": audio, "moved": moved}
    return {**{key: value for key, value in vars(edit).items() if key != "takes"}, **own}
