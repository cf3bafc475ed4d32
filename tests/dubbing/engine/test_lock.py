"""The lock is a file of its own, whatever lies in its place."""

import os
from pathlib import Path

import pytest

from dubbing.engine import lock
from dubbing.errors import DubbingError, LockedError


def take(folder: Path) -> None:
    with lock.hold(folder):
        pass


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("precious")
    work = tmp_path / "work"
    work.mkdir()
    (work / ".lock").symlink_to(other)
    with pytest.raises(DubbingError, match=r"the lock is a link .*remove it"):
        take(work)
    (work / ".lock").unlink()
    os.link(other, work / ".lock")
    with pytest.raises(DubbingError, match="the lock is another file"):
        take(work)
    assert other.read_text() == "precious"


@pytest.mark.parametrize("kind", ["pipe", "folder"])
def test_what_is_no_file_is_said_at_once(tmp_path: Path, kind: str) -> None:
    (os.mkfifo if kind == "pipe" else os.mkdir)(tmp_path / ".lock")
    with pytest.raises(DubbingError, match=r"the lock is another file|a folder lies where a file"):
        take(tmp_path)


def test_a_disk_that_takes_nothing_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> int:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(os, "open", refused)
    with pytest.raises(DubbingError, match=r"Read-only file system .*\.lock"):
        take(tmp_path)


def test_junk_in_the_lock_is_not_shown(tmp_path: Path) -> None:
    with lock.hold(tmp_path):
        (tmp_path / ".lock").write_text("\x1b[31m")
        with pytest.raises(LockedError, match="wait for process unknown"):
            take(tmp_path)
