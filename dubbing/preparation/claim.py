"""Claims a folder for `prepare`: an empty one, or one that it has made itself."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dubbing.engine.disk import claims
from dubbing.engine.disk.files import make_folder
from dubbing.engine.running.update import TEMPORARY
from dubbing.errors import CallError
from dubbing.preparation.file_names import CONTACT_SHEET, SUMMARY
from dubbing.preparation.prepared import BACKGROUND, MATTE, TRACK

MARKS = (SUMMARY, "steps/key.json")  # files of `prepare`: one of them lies in a folder it has used
CLAIMED = "prepare"
WRITTEN = (TRACK, MATTE, BACKGROUND, CONTACT_SHEET, SUMMARY)


@contextmanager
def claimed(folder: Path, clip: Path) -> Iterator[None]:
    """Hold the folder for one run, and make it where it does not exist.

    Raises:
        CallError: it holds other files, or the clip would be overwritten.
        LockedError: another run prepares a clip there.
        ExplainedError: it cannot be made.
    """
    if clip.resolve() in {(folder / name).resolve() for name in WRITTEN}:
        raise CallError("the clip itself would be overwritten", str(clip), "choose another folder")
    make_folder(folder)
    if not any((folder / mark).is_file() for mark in MARKS) and _holds_files(folder):
        remedy = "name an empty folder, or one that does not exist yet"
        raise CallError("other files lie there, which might be lost", str(folder), remedy)
    with claims.hold(folder / CLAIMED):
        yield


def _holds_files(folder: Path) -> bool:
    """Whether the folder holds other files than an interrupted `prepare` leaves behind."""
    return any(
        not (path.name == "steps" or claims.SUFFIX in path.name or path.match(TEMPORARY))
        for place in (folder, folder / "steps")
        if place.is_dir()
        for path in place.iterdir()
    )
