"""The file beside a manifest that holds the edits of one dub, as its key `edits` would."""

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from dubbing.engine.disk.files import atomic_write_bytes
from dubbing.errors import Problem
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.keys.edit_entry import Edit

SUFFIX = ".edits.yaml"
MOST_BYTES = 10**7
LONGEST_ROW = 10**6  # characters: nothing is folded, so that every text comes back as it was
HEADER = (
    "# Edits of lines, which `dfrf dub` reads. Written by `dfrf studio`, which keeps no comment.\n"
)


def edits_file(manifest: Path, dub: str) -> Path:
    """Where the edits of a dub lie; there may be none."""
    return manifest.parent / f"{dub}{SUFFIX}"


def read(path: Path) -> yaml_lines.Document:
    """The edits in a file, as plain data, with the lines that they stand on."""
    try:
        document = yaml_lines.read_file(path, MOST_BYTES)
    except ValueError as error:
        return yaml_lines.Document([], problems=[Problem(0, "", str(error))])
    if document.data is None:
        document.data = []
    return document


def text_of(edits: Sequence[Edit], folder: Path) -> bytes:
    """Edits as such a file in a folder holds them: the same bytes for the same edits."""
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.default_flow_style, yaml.allow_unicode, yaml.width = None, True, LONGEST_ROW
    yaml.sort_base_mapping_type_on_output = False
    out = io.StringIO()
    yaml.dump([_plain(edit.model_dump(exclude_defaults=True), folder) for edit in edits], out)
    return (HEADER + out.getvalue()).encode()


def write(path: Path, edits: Sequence[Edit]) -> None:
    """Put edits into a file, or remove it where there are none."""
    if edits:
        atomic_write_bytes(path, text_of(edits, path.parent))
    else:
        path.unlink(missing_ok=True)


def _plain(value: Any, folder: Path) -> Any:
    """Values as they are written by hand: 80 and not 80.0, paths as they are seen from a folder."""
    if isinstance(value, dict):
        return {key: _plain(one, folder) for key, one in value.items()}
    if isinstance(value, list):
        return [_plain(one, folder) for one in value]
    if isinstance(value, Path):
        return os.path.relpath(value, folder) if value.is_relative_to(folder) else str(value)
    whole = isinstance(value, float) and value.is_integer()
    return int(value) if whole else value
