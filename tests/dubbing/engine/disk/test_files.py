import errno
import os
from pathlib import Path

import pytest

from dubbing.engine.disk import files
from dubbing.engine.disk.files import (
    atomic_path,
    atomic_write_text,
    checksum_of,
    digest_data,
    digest_file,
    make_folder,
    read_bounded,
    remove_torn,
    sync_file,
)
from dubbing.errors import ExplainedError, ManifestError, Problem


def test_a_file_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "a.txt"
    atomic_write_text(target, "old")

    def fail() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            assert target.read_text() == "old"
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert target.read_text() == "old"
    atomic_write_text(target, "new")
    assert [(p.name, p.read_text()) for p in target.parent.iterdir()] == [("a.txt", "new")]


def test_the_suffix_is_kept_for_ffmpeg(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "a.tar.mkv") as temporary:
        assert temporary.suffix == ".mkv"
        temporary.write_bytes(b"x")


def test_a_folder_that_cannot_be_written_to_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    for path, message in (("file", "File exists"), ("file/out", "Not a directory")):
        with pytest.raises(ExplainedError, match=rf"{message} .*: choose another folder"):
            make_folder(tmp_path / path)
    # Whoever runs the tests may be allowed everything.
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(ExplainedError, match="nothing may be written there"):
        make_folder(tmp_path / "a")


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (errno.ENOSPC, "No space left on device .*: free some space"),
        (errno.EROFS, "Read-only file system .*: see whether the disk"),
    ],
)
def test_what_the_disk_refuses_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, message: str
) -> None:
    def refused(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    atomic_write_text(tmp_path / "a", "old")
    for what in ("os.replace", "os.fsync", "pathlib.Path.write_bytes"):
        with monkeypatch.context() as patch:
            patch.setattr(what, refused)
            with pytest.raises(ExplainedError, match=message):
                atomic_write_text(tmp_path / "a", "new")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("a", "old")]


def test_a_folder_in_the_place_of_a_file_is_reported(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(ExplainedError, match=r"a folder lies where .*: move it away"):
        atomic_write_text(tmp_path / "a", "x")
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_only_torn_files_of_one_name_are_removed(tmp_path: Path) -> None:
    for name in (".a.17.tmp.mp4", ".ab.17.tmp.mp4", ".a.x.tmp.mp4", ".a.17.tmp.wav", "a.mp4"):
        (tmp_path / name).touch()
    remove_torn(tmp_path / "a.mp4")
    assert ".a.17.tmp.mp4" not in {p.name for p in tmp_path.iterdir()}
    assert len(list(tmp_path.iterdir())) == 4


def test_digests(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"x" * 3_000_000)
    (tmp_path / "b").write_bytes(b"x" * 3_000_000 + b"y")
    assert digest_file(tmp_path / "a") != digest_file(tmp_path / "b")
    assert len(digest_file(tmp_path / "a")) == 32
    assert digest_data({"a": 1, "b": [2.5]}) == digest_data({"b": [2.5], "a": 1})
    assert digest_data({"a": 1}) != digest_data({"a": "1"})


def test_errors_survive_a_worker_process() -> None:
    import pickle

    error = pickle.loads(pickle.dumps(ExplainedError("what", "where", "remedy")))
    assert (error.what, error.where, error.remedy) == ("what", "where", "remedy")
    assert str(error) == "what (where): remedy"
    problems = [Problem(2, "b", "x"), Problem(1, "a", "y")]
    several = pickle.loads(pickle.dumps(ManifestError("m.yaml", problems)))
    assert str(several) == "2 problems in m.yaml\n  line 1: a: y\n  line 2: b: x"


def test_without_the_flags_of_unix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("O_NONBLOCK", "O_CLOEXEC"):
        monkeypatch.delattr(os, name)
    monkeypatch.setattr(os, "O_BINARY", 0, raising=False)
    (tmp_path / "a").write_bytes(b"a\r\n\x1a")
    assert read_bounded(tmp_path / "a", 10) == b"a\r\n\x1a"


def test_windows_flushes_files_that_may_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").write_bytes(b"x")
    opened: list[tuple[object, int]] = []
    really = os.open

    def note(path: str, flags: int) -> int:
        opened.append((path, flags))
        return really(path, flags)

    folder, file = tmp_path, tmp_path / "a"
    with monkeypatch.context() as patch:
        patch.setattr(os, "open", note)
        patch.setattr(files, "WINDOWS", True)
        sync_file(folder)
        sync_file(file)
    assert opened == [(file, os.O_RDWR)]


@pytest.mark.parametrize(("refusals", "ends"), [(2, "new"), (99, "old")])
def test_windows_is_asked_again_while_somebody_has_the_file_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refusals: int, ends: str
) -> None:
    (tmp_path / "a").write_text("old")
    really, asked = os.replace, 0

    def refused(source: Path, target: Path) -> None:
        nonlocal asked
        asked += 1
        if asked <= refusals:
            raise PermissionError(errno.EACCES, "The process cannot access the file")
        really(source, target)

    error = None
    monkeypatch.setattr(files, "PAUSES_S", (0.0, 0.0, 0.0))
    monkeypatch.setattr(os, "replace", refused)
    with monkeypatch.context() as patch:
        patch.setattr(files, "sync_file", lambda path: None)  # opens folders here
        patch.setattr(files, "WINDOWS", True)
        try:
            with atomic_path(tmp_path / "a") as temporary:
                temporary.write_text("new")
        except ExplainedError as raised:
            error = raised
    assert (tmp_path / "a").read_text() == ends
    assert (error is None) == (ends == "new")
    if error is not None:
        assert error.remedy.startswith("close the programs that have it open")


def test_a_path_on_another_drive_stays_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    assert files.seen_from(Path("/films/out"), Path("/films/a b.mp4")) == "../a b.mp4"

    def no_way(*_: object) -> str:
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr("os.path.relpath", no_way)
    assert files.seen_from(Path("/films/out"), Path("/films/a b.mp4")) == "/films/a b.mp4"


def test_a_file_is_on_the_disk_before_its_name_and_the_name_before_anything_else(
    tmp_path: Path, flushed: list[tuple[str, Path]]
) -> None:
    """A cut of the power leaves the old file or the new one, and no later file without it."""
    (tmp_path / "a").write_text("old")
    with atomic_path(tmp_path / "a") as temporary:
        temporary.write_text("new")
    assert flushed == [("flushed", temporary), ("named", tmp_path / "a"), ("flushed", tmp_path)]


def test_a_checksum_tells_a_changed_byte(tmp_path: Path) -> None:
    path = tmp_path / "large"
    path.write_bytes(bytes(3 << 20))
    before = checksum_of(path)
    with path.open("r+b") as file:
        file.seek(2 << 20)
        file.write(b"1")
    assert checksum_of(path) != before
    assert len(before) == 8
