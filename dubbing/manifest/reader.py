"""Reading a manifest: its sections and entries, and everything that is wrong with them."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dubbing.engine.disk.files import same_on_disk
from dubbing.errors import Problem
from dubbing.manifest.checks import inputs, overwriting
from dubbing.manifest.edits import edits_file
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.findings import Findings
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.messages import describe, plain, suggestion
from dubbing.manifest.keys.values import as_name, check_name, place_of
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.production.production import WORK

TOP = ("version", "output", "timeline", "defaults", "identities", "dubs")
# Stands in for a wrong value, so that the rest of its entry can be checked too.
UNKNOWN: dict[str, Any] = {
    "consent": {"by": "who it was", "reference": "where it was"},
    "identity": "?",
    "name": "?",
}


class Reader:
    """Reads a manifest and collects its problems; every part that can be understood is checked."""

    def __init__(
        self, path: Path, document: yaml_lines.Document, only: tuple[str, ...] = ()
    ) -> None:
        self.path, self.only = path, only
        self.document = document
        self.found: list[tuple[KeyPath, str]] = []
        self.edits: dict[KeyPath, tuple[str, yaml_lines.Document]] = {}  # in files of their own
        self.data: Mapping[str, Any] = document.data if isinstance(document.data, dict) else {}
        self.defaults = self._section("defaults", dict, {})
        self.timeline: Path | None = None

    def problems(self) -> list[Problem]:
        """All problems, each once, with their lines."""
        found = []
        for path, message in self.found:
            if path[:3] in self.edits:
                found.append(_of_file(*self.edits[path[:3]], path[3:], message))
                continue
            written = self._written(path)
            key = yaml_lines.key_path(written)
            found.append(Problem(self.document.line(written), key, message))
        for name, document in self.edits.values():
            found += [Problem(0, name, str(one)) for one in document.problems]
        return list(dict.fromkeys([*self.document.problems, *found]))

    def read(self) -> tuple[Path | None, dict[int, Dub], Findings]:
        """Output folder, dubs by their place in the list, and what the files hold.

        Where there are `problems` some of it is missing.
        """
        if not self.data:
            if not self.document.problems:
                self._add((), "must hold version, output, identities and dubs")
            return None, {}, Findings()
        self._check_top()
        self.timeline = self._timeline()
        output, identities, dubs = self._output(), self._identities(), self._dubs()
        identities = {name: identity.with_options() for name, identity in identities.items()}
        dubs = {place: dub.over(identities) for place, dub in dubs.items()}
        findings = inputs.inspect(*self._selected(identities, dubs))
        self.found += findings.problems
        if output is not None:
            self.found += overwriting.problems(self.path, output, identities, dubs, findings.media)
        return output, dubs, findings

    def _selected(
        self, identities: dict[str, Identity], dubs: dict[int, Dub]
    ) -> tuple[dict[str, Identity], dict[int, Dub]]:
        """The entries that ``only`` names, and what they need."""
        if not self.only:
            return identities, dubs
        some = {k: dub for k, dub in dubs.items() if dub.name in self.only}
        named = {*self.only, *(name for dub in some.values() for name in dub.people)}
        return {name: i for name, i in identities.items() if name in named}, some

    def _check_top(self) -> None:
        for key in self.data:
            if key not in TOP:
                self._add((key,), "unknown key" + suggestion(key, TOP))
        version = self.data.get("version")
        if version != 1 or isinstance(version, bool):
            self._add(("version",), "must be 1" if "version" in self.data else "is required: 1")
        known = {*Identity.model_fields, *Dub.model_fields}
        for key in self.defaults:
            if key not in known:
                self._add(("defaults", key), "unknown key" + suggestion(key, known))

    def _output(self) -> Path | None:
        output = self._path("output", "is required: the folder for the results")
        for folder in (output, output / WORK) if output is not None else ():
            if problem := overwriting.unwritable(folder):
                self._add(("output",), problem)
                break
        return output

    def _timeline(self) -> Path | None:
        if self.data.get("timeline") is None:
            return None
        path = self._path("timeline", "must be the path of a file")
        if path is not None and not path.is_file():
            self._add(("timeline",), f"no such file: {path}")
            return None
        return path

    def _path(self, key: str, problem: str) -> Path | None:
        """The path at a key of no entry; None, and a problem, where that holds none."""
        value = self.data.get(key)
        try:
            if not isinstance(value, str) or not value.strip():
                raise ValueError(problem)
            return place_of(value, self.path.parent)
        except ValueError as error:
            self._add((key,), str(error))
            return None

    def _identities(self) -> dict[str, Identity]:
        section = self._section("identities", dict, {})
        if not section and "identities" in self.data and isinstance(self.data["identities"], dict):
            self._add(("identities",), "names nobody")
        found: dict[str, Identity] = {}
        for name, entry in section.items():
            try:
                check_name(name)
            except ValueError as error:
                self._add(("identities", name), f"the name {error}")
            item = self._entry(Identity, ("identities", name), self._first_clip(name, entry))
            if isinstance(item, Identity):
                found[name] = item
        self._unique([(name, ("identities", name)) for name in section])
        return found

    def _first_clip(self, name: str, entry: Any) -> Any:
        """An identity with several clips, beginning with the first of them."""
        if not isinstance(entry, dict) or "clips" not in entry:
            return entry
        if "clip" in entry:
            self._add(("identities", name, "clip"), "give either clip or clips")
            return entry
        clips = entry["clips"]
        named = isinstance(clips, list) and clips and isinstance(clips[0], str)
        return {**entry, "clip": clips[0]} if named else entry

    def _dubs(self) -> dict[int, Dub]:
        identities = self.data.get("identities")
        known = identities if isinstance(identities, dict) else {}
        found: dict[int, Dub] = {}
        for k, entry in enumerate(self._section("dubs", list, [])):
            named = entry
            if isinstance(entry, dict) and "name" not in {**self.defaults, **entry}:
                named = {"name": _default_name({**self.defaults, **entry}), **entry}
            self._check_people(("dubs", k), named, known)
            item = self._entry(Dub, ("dubs", k), self._with_edits(k, named))
            if isinstance(item, Dub):
                found[k] = item
        names = [(dub.name, ("dubs", k, "name")) for k, dub in found.items()]
        self._unique([(name, path) for name, path in names if name != UNKNOWN["name"]])
        return found

    def _with_edits(self, place: int, entry: Any) -> Any:
        """A dub with the edits of the file beside the manifest, where there is one."""
        name = {**self.defaults, **entry}.get("name") if isinstance(entry, dict) else None
        if not isinstance(name, str) or "\0" in name:
            return entry
        path = edits_file.edits_file(self.path, name)
        if path.parent != self.path.parent or not os.path.lexists(path):
            return entry
        at: KeyPath = ("dubs", place, "edits")
        if "edits" in {**self.defaults, **entry}:
            self._add(at, f"{path.name} holds edits of this dub, too: move all into one of the two")
            return entry
        document = edits_file.read(path)
        self.edits[at] = path.name, document
        return {**entry, "edits": document.data}

    def _check_people(self, at: KeyPath, entry: Any, known: Mapping[str, Any]) -> None:
        """Check that the people of a dub are among the identities."""
        if not isinstance(entry, dict) or not known:
            return
        speakers = entry.get("speakers")
        named: dict[KeyPath, Any] = {("identity",): entry.get("identity")}
        if isinstance(speakers, dict):
            named |= {("speakers", name): whose for name, whose in speakers.items()}
        for key, whose in named.items():
            if isinstance(whose, str) and whose not in known:
                there = ", ".join(known)
                self._add((*at, *key), f"no identity {whose!r}; there is {there}")

    def _entry(self, model: type[Entry], path: KeyPath, entry: Any) -> Entry | None:
        if not isinstance(entry, dict):
            self._add(path, f"must hold keys, not {describe(entry)}")
            return None
        merged = {k: v for k, v in self.defaults.items() if k in model.model_fields}
        for key, value in entry.items():
            inherited = merged.get(key)
            both = isinstance(value, dict) and isinstance(inherited, dict)
            merged[key] = {**inherited, **value} if both and inherited else value
        context = {"folder": self.path.parent}
        try:
            return model.model_validate(merged, context=context)
        except ValidationError as error:
            wrong = {detail["loc"][0] for detail in error.errors()}
            for detail in error.errors():
                self._add((*path, *detail["loc"]), plain(detail, model))
        # What was understood is still checked against the files, to report all at once.
        kept = {key: value for key, value in merged.items() if key not in wrong}
        stand_in = {key: value for key, value in UNKNOWN.items() if key in wrong}
        try:
            return model.model_validate({**kept, **stand_in}, context=context)
        except ValidationError:
            return None

    def _written(self, path: KeyPath) -> KeyPath:
        """Where the value at ``path`` was written: there, or under ``defaults``.

        The only one of several can be written without a list.
        """
        own, lines = path[:3], self.document.lines
        if len(path) > 2 and own not in lines and path[2] in self.defaults:
            path = ("defaults", *path[2:])
        return tuple(part for k, part in enumerate(path) if part != 0 or path[: k + 1] in lines)

    def _section(self, key: str, kind: type, empty: Any) -> Any:
        value = self.data.get(key)
        if isinstance(value, kind):
            return value
        if value is not None:
            self._add((key,), f"must be a {'list' if kind is list else 'mapping'}")
        elif key == "identities" and self.data:
            self._add((key,), "is required: who was filmed")
        return empty

    def _unique(self, names: list[tuple[str, KeyPath]]) -> None:
        seen: dict[str, KeyPath] = {}
        for name, path in names:
            other = seen.setdefault(same_on_disk(name), path)
            if other != path:
                where = f"{yaml_lines.key_path(other)} (line {self.document.line(other)})"
                self._add(path, f"the name {name!r} is taken by {where}")

    def _add(self, path: KeyPath, message: str) -> None:
        self.found.append((path, message))


def _of_file(name: str, document: yaml_lines.Document, path: KeyPath, message: str) -> Problem:
    """A problem of a file of edits, whose only one can be written without a list."""
    path = tuple(part for k, part in enumerate(path) if k or part or path[:1] in document.lines)
    key = yaml_lines.key_path(path)
    place = f"{name}, line {document.line(path)}"
    return Problem(0, place, f"{key}: {message}" if key else message)


def _default_name(entry: Mapping[str, Any]) -> str:
    if "lines" in entry:
        return as_name(Path(str(entry["lines"])).stem)
    stem = Path(str(entry.get("audio", ""))).stem
    return as_name(f"{entry.get('identity', '')}_{stem}")
