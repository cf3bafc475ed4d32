"""Results that would take the place of what a manifest reads, or cannot be written at all."""

import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from dubbing.engine.disk.files import same_on_disk
from dubbing.engine.disk.numbered import plain
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.yaml_lines import KeyPath, key_path
from dubbing.production.dub import previous_of, results_of
from dubbing.production.production import REPORTS, WORK

OF_ALL = (*REPORTS, "evaluate.json")


def problems(
    manifest: Path,
    output: Path,
    identities: Mapping[str, Identity],
    dubs: Mapping[int, Dub],
    sounds: Iterable[Path] = (),
) -> Iterator[tuple[KeyPath, str]]:
    """Where a result and an input are one file, by name, link or inode; and inputs in ``work``.

    Also where results of two dubs are one file.

    Args:
        dubs: by their place in the list.
        sounds: of cues, whose names the manifest gives as a pattern.
    """
    inputs: dict[Path, str] = {manifest: "this manifest"}
    entries: list[tuple[KeyPath, Entry]] = [(("identities", n), i) for n, i in identities.items()]
    entries += [(("dubs", place), dub) for place, dub in dubs.items()]
    for at, entry in entries:
        for key, value in _files(entry):
            inputs.setdefault(value, key_path((*at, *key)))
            if Path(os.path.realpath(output / WORK)) in value.parents:
                yield (*at, *key), f"{value} lies where the stages work: move it elsewhere"
    for path in sounds:
        inputs.setdefault(path, str(path))
    known = {one: name for path, name in inputs.items() for one in _identities(path)}
    results: list[tuple[KeyPath, str]] = [(("output",), name) for name in OF_ALL]
    for place, dub in dubs.items():
        for name in results_of(dub.name, dub.codec).values():
            results += [(("dubs", place), name), (("dubs", place), previous_of(dub.name, name))]
    yield from _clashes(dubs)
    for at, name in results:
        if (output / name).is_dir():
            yield at, f"{output / name} is a folder, where a file should go: move it away"
        taken = next((known[i] for i in _identities(output / name) if i in known), None)
        if taken is not None:
            remedy = "choose another output" + ("" if at == ("output",) else " or name")
            yield at, f"{output / name} would take the place of {taken}: {remedy}"


def _clashes(dubs: Mapping[int, Dub]) -> Iterator[tuple[KeyPath, str]]:
    taken: dict[str, Dub] = {}
    for place, dub in dubs.items():
        own = [*results_of(dub.name, dub.codec).values()]
        for name in (*own, *(previous_of(dub.name, one) for one in own)):
            before = taken.setdefault(same_on_disk(name), dub)
            # Where their names are one, `Reader` says so.
            if same_on_disk(before.name) != same_on_disk(dub.name):
                both = f"dubs {before.name!r} and {dub.name!r}"
                yield ("dubs", place), f"{name} would be of {both}: rename one"
                break


def _files(entry: Entry) -> Iterator[tuple[KeyPath, Path]]:
    """The files that an entry names, alone, in lists and in mappings, with their keys in it."""
    for key, value in entry:
        for one in _several(value):
            if isinstance(one, Path):
                yield (key,), one
            elif isinstance(one, Entry):
                yield from (((key, *inner), path) for inner, path in _files(one))


def _several(value: object) -> Iterable[object]:
    """The values of a mapping or of a list, or the one value that there is."""
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, tuple) else (value,)


def unwritable(folder: Path) -> str:
    """Why nothing could be written to a folder, that may be still to be made; else empty."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if not there.is_dir():
        return f"{there} is a file, not a folder"
    try:  # rights are not enough: root has them on a disk that takes nothing
        with tempfile.TemporaryFile(dir=there):
            return ""
    except OSError as error:
        return f"nothing can be written in {there}: {error.strerror}"


def _identities(path: Path) -> Iterator[object]:
    """Names of a file that tell it apart: its path without links, and its inode, if it exists."""
    path = plain(path)
    yield Path(os.path.realpath(path))  # of a link to itself, too
    try:
        status = os.stat(path)
    except OSError:
        return
    yield status.st_dev, status.st_ino
