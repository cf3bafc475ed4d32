"""The file of a dub's edits, read and written by what it says of the dub's lines."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dubbing.errors import ExplainedError
from dubbing.manifest.edits import edits_file
from dubbing.manifest.edits.edits import edits_of
from dubbing.manifest.keys import edit_entry, yaml_lines
from dubbing.manifest.keys.findings import Findings, Scene
from dubbing.manifest.keys.messages import plain
from dubbing.production.dub import Dub
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue


class StaleError(ExplainedError):
    """Edits were saved by somebody else in the meantime."""


@dataclass(frozen=True)
class KeptEdits:
    """The edits of a dub in the file beside its manifest."""

    manifest: Path
    dub: Dub

    @property
    def path(self) -> Path:
        """The file; there may be none."""
        return edits_file.edits_file(self.manifest, self.dub.name)

    def read(self) -> tuple[str, list[edit_entry.Edit]]:
        """Revision and content of the file.

        Raises:
            ExplainedError: it holds something else.
        """
        path = self.path
        document = edits_file.read(path) if path.exists() else yaml_lines.Document([])
        content = path.read_bytes() if path.exists() else b""
        revision = hashlib.sha256(content).hexdigest()[:16]
        if document.problems:
            raise ExplainedError(str(document.problems[0]), path.name, "mend the file")
        data = document.data if isinstance(document.data, list) else [document.data]
        return revision, [validated(one, path.name, path.parent) for one in data]

    def edits(self) -> dict[str, Edit]:
        """The edits of the dub by the names of its cues; as spoken for the others."""
        if self.dub.fixed_edits:
            return {cue.name: cue.edit for cue in self.dub.cues}
        found = self._checked(self.read()[1])
        return {cue.name: found.get(cue.name, Edit()) for cue in self.dub.cues}

    def entries(self) -> tuple[str, dict[Cue, edit_entry.Edit]]:
        """Revision and content of the file by the cues of the dub, before something is put there.

        Raises:
            ExplainedError: it cannot be read, or the manifest itself holds the edits.
        """
        if self.dub.fixed_edits:
            what = f"the manifest holds the edits of {self.dub.name}"
            raise ExplainedError(what, remedy=f"move them to {self.path.name} beside it")
        revision, edits = self.read()
        return revision, {self._cue(one): one for one in edits}

    def plain(self, cue: Cue) -> edit_entry.Edit:
        """The entry of a cue as spoken."""
        return edit_entry.Edit(**self.line(cue))

    def line(self, cue: Cue) -> dict[str, Any]:
        """The keys that say which line an edit is of."""
        several = sum(one.number == cue.number for one in self.dub.cues) > 1
        return {"line": cue.number} | ({"speaker": cue.speaker} if several else {})

    def put(self, entries: Mapping[Cue, edit_entry.Edit], changed: Mapping[Cue, Any]) -> None:
        """Write entries, in the order of their lines, without those that changed to as spoken.

        Raises:
            ExplainedError: they are wrong, or cannot be written.
        """
        kept = [cue for cue in self.dub.cues if cue in entries]
        new = [
            entries[cue] for cue in kept if cue not in changed or entries[cue] != self.plain(cue)
        ]
        self._checked(new)
        edits_file.write(self.path, new)

    def _cue(self, edit: edit_entry.Edit) -> Cue:
        name = next(iter(self._checked([edit])))
        return next(cue for cue in self.dub.cues if cue.name == name)

    def _checked(self, edits: list[edit_entry.Edit]) -> Mapping[str, Edit]:
        dub, findings = self.dub, Findings()
        scene = Scene(
            dub.film.path, dub.cues, undubbed=dub.undubbed, film_heard=dub.sound.film_heard
        )
        presets = {person.name: person.settings.preset for person in dub.people}
        found = edits_of(findings, (), edits, scene, presets)
        if findings.problems:
            key, message = findings.problems[0]
            raise ExplainedError(f"{yaml_lines.key_path(key[1:])}: {message}".lstrip(": "))
        return found


def validated(given: Any, where: str, folder: Path) -> edit_entry.Edit:
    """An entry of plain data, whose paths are seen from a folder.

    Raises:
        ExplainedError: it is none.
    """
    try:
        return edit_entry.Edit.model_validate(given, context={"folder": folder})
    except ValidationError as error:
        detail = error.errors()[0]
        key = yaml_lines.key_path(tuple(detail["loc"]))
        message = plain(detail, edit_entry.Edit)
        raise ExplainedError(f"{key}: {message}" if key else message, where) from None
