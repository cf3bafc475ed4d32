"""The manifest of `dfrf dub CLIP SPEECH -o OUT`: one person, one dub, beside its result."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dubbing.engine.disk.files import atomic_write_text, make_folder
from dubbing.errors import CallError, ManifestError
from dubbing.manifest.keys.values import as_name
from dubbing.manifest.keys.yaml_lines import quoted
from dubbing.media import SUFFIX

PREVIEW = ".preview"  # after the name of a dub whose first seconds are made
CODECS = {suffix: codec for codec, suffix in reversed(SUFFIX.items())}  # the first of several
HEADER = """\
# Written by `dfrf dub` from what it was called with. To change more, edit it and run
# `dfrf dub` on this file; `dfrf studio` on it edits the lips.
"""


@contextmanager
def written(
    clip: Path, speech: Path, out: Path, consent: str, preview: float | None = None
) -> Iterator[tuple[Path, str]]:
    """Write the manifest beside `out`; gives its path and the name of the dub to make.

    Where it turns out to be wrong, it is as it was before.

    Raises:
        CallError: something of the call is wrong, or there is another manifest.
    """
    for file in (clip, speech):
        if not file.is_file():
            raise CallError("no such file", str(file))
    if out.suffix.lower() not in CODECS:
        raise CallError(
            f"no video is written as {out.name!r}", "--output", "use .mp4, .mov or .mkv"
        )
    by, _, reference = (part.strip() for part in consent.partition(","))
    if not by or not reference:
        remedy = '"Ann Smith, release form 17"'
        raise CallError("who agreed, and where is that written down?", "--consent", f"as {remedy}")
    path = out.with_suffix(".yaml")
    base = _text(clip, speech, out, by, reference)
    before = path.read_text(encoding="utf-8") if path.exists() else None
    if before is not None and not _ours(before, base):
        what = "is there, and is not what this call would write"
        raise CallError(what, str(path), f"run dfrf dub {path}, or give another --output")
    name = out.stem + PREVIEW * (preview is not None)
    # A preview stays, so that its results stay known.
    text = base + _dub(speech, out, preview) if preview is not None else before or base
    make_folder(out.parent)
    atomic_write_text(path, text)
    try:
        yield path, name
    except ManifestError:
        if before is None:
            path.unlink()
        else:
            atomic_write_text(path, before)
        raise


def _text(clip: Path, speech: Path, out: Path, by: str, reference: str) -> str:
    person = quoted(as_name(clip.stem))
    return (
        f"{HEADER}version: 1\noutput: .\nidentities:\n  {person}:\n"
        f"    clip: {quoted(_seen(clip, out))}\n"
        f"    consent: {{by: {quoted(by)}, reference: {quoted(reference)}}}\n"
        f"defaults: {{identity: {person}, codec: {CODECS[out.suffix.lower()]}}}\ndubs:\n"
        f"{_dub(speech, out, None)}"
    )


def _dub(speech: Path, out: Path, preview: float | None) -> str:
    name = quoted(out.stem + PREVIEW * (preview is not None))
    first = f", audio_seconds: {preview:g}" if preview is not None else ""
    return f"  - {{name: {name}, audio: {quoted(_seen(speech, out))}{first}}}\n"


def _ours(before: str, base: str) -> bool:
    """Whether a text is a manifest of this call, perhaps with a preview."""
    rest = before.removeprefix(base)
    return before.startswith(base) and rest.count("\n") <= 1 and (not rest or PREVIEW in rest)


def _seen(file: Path, out: Path) -> str:
    """A file as the manifest names it: both may be moved together, where one folder holds both."""
    file, folder = file.absolute(), out.absolute().parent
    return os.path.relpath(file, folder) if file.is_relative_to(folder) else str(file)
