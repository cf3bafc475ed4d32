"""Results that would take the place of what a manifest reads, or cannot be written at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from dubbing.manifest.entries import Dub, Entry, Identity
from dubbing.manifest.yaml_lines import key_path
from dubbing.media import SUFFIX

KeyPath = tuple[str | int, ...]
WORK = "work"  # folder of the stages, in the output folder
OF_ALL = ("report.html", "report.json", "evaluate.json")


def results_of(name: str, codec: str) -> tuple[str, str]:
    """The names of the two files that a dub becomes: the video and its sync check."""
    return f"{name}{SUFFIX[codec]}", f"{name}.sync.json"


def problems(
    manifest: Path, output: Path, identities: Mapping[str, Identity], dubs: Mapping[int, Dub]
) -> Iterator[tuple[KeyPath, str]]:
    """Where a result and an input are one file, by name, link or inode; and inputs in ``work``.

    Args:
        dubs: by their place in the list.
    """
    inputs: dict[Path, str] = {manifest: "this manifest"}
    entries: list[tuple[KeyPath, Entry]] = [(("identities", n), i) for n, i in identities.items()]
    entries += [(("dubs", place), dub) for place, dub in dubs.items()]
    for at, entry in entries:
        for key, value in _files(entry):
            inputs.setdefault(value, key_path((*at, *key)))
            if (output / WORK).resolve() in value.parents:
                yield (*at, *key), f"{value} lies where the stages work: move it elsewhere"
    known = {found: said for path, said in inputs.items() for found in _identities(path)}
    results: list[tuple[KeyPath, str]] = [(("output",), name) for name in OF_ALL]
    for place, dub in dubs.items():
        results += [(("dubs", place), name) for name in results_of(dub.name, dub.codec)]
    for at, name in results:
        if (output / name).is_dir():
            yield at, f"{output / name} is a folder, where a file should go: move it away"
        said = next((known[i] for i in _identities(output / name) if i in known), None)
        if said is not None:
            remedy = "choose another output" + ("" if at == ("output",) else " or name")
            yield at, f"{output / name} would take the place of {said}: {remedy}"


def _files(entry: Entry) -> Iterator[tuple[KeyPath, Path]]:
    """The files that an entry names, with their keys in it."""
    for key, value in entry:
        if isinstance(value, Path):
            yield (key,), value
        elif isinstance(value, Entry):
            yield from (((key, *inner), path) for inner, path in _files(value))


def unwritable(folder: Path) -> str:
    """Why nothing could be written to a folder, that may be still to be made; else empty."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if not there.is_dir():
        return f"{there} is a file, not a folder"
    try:  # rights do not tell all: root has them on a disk that takes nothing
        with tempfile.TemporaryFile(dir=there):
            return ""
    except OSError as error:
        return f"nothing can be written in {there}: {error.strerror}"


def _identities(path: Path) -> Iterator[object]:
    """What a file is known by: its path without links, and where there is one its inode."""
    yield path.resolve()
    try:
        status = os.stat(path)
    except OSError:
        return
    yield status.st_dev, status.st_ino
