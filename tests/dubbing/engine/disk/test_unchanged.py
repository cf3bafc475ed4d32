"""Findings about a file hold until it changes, in later processes as well."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

LOOK = """
import sys
from pathlib import Path
from dubbing.engine.disk import unchanged
from dubbing.engine.disk.unchanged import keep_in, while_unchanged

unchanged.SETTLED_S = float(sys.argv[4])

@while_unchanged(8, kept=str)
def look(path: Path) -> str:
    print("read")
    return path.read_text()

keep_in(Path(sys.argv[1]), sys.argv[2])
print(look(Path(sys.argv[3])))
"""


IN_A_CHILD = f"""
from multiprocessing import get_context

child = get_context("fork").Process(target=exec, args=({LOOK!r}, {{"__name__": ""}}))
child.start()
child.join()
"""


@pytest.fixture
def text(tmp_path: Path) -> Path:
    path = tmp_path / "text"
    path.write_text("old")
    return path


def look(
    kept: Path, text: Path, version: str = "1", settled: float = 0, program: str = LOOK
) -> list[str]:
    """The output of a process that looks into the text; it trusts files of so many seconds."""
    command = [sys.executable, "-c", program, str(kept), version, str(text), str(settled)]
    return subprocess.check_output(command, text=True).split()


def test_a_later_process_reads_a_file_again_only_if_it_changed(tmp_path: Path, text: Path) -> None:
    kept = tmp_path / "caches" / "files.json"
    assert look(kept, text) == ["read", "old"]
    assert look(kept, text) == ["old"]
    assert look(kept, text, version="2") == ["read", "old"]
    was = text.stat()
    text.write_text("new")  # as long, and its time is put back
    os.utime(text, ns=(was.st_atime_ns, was.st_mtime_ns))
    assert look(kept, text, version="2") == ["read", "new"]


def test_a_child_of_multiprocessing_keeps_what_it_finds(tmp_path: Path, text: Path) -> None:
    """It ends without what `atexit` is for."""
    kept = tmp_path / "files.json"
    assert look(kept, text, program=IN_A_CHILD) == ["read", "old"]
    assert look(kept, text, program=IN_A_CHILD) == ["old"]


def test_a_file_that_has_just_changed_is_not_trusted(tmp_path: Path, text: Path) -> None:
    os.utime(text, ns=(0, 0))
    for _ in range(2):
        assert look(tmp_path / "files.json", text, settled=3600) == ["read", "old"]


@pytest.mark.parametrize("damage", ["no JSON", "[]", '{"version": "1", "known": {"a": 1}}', None])
def test_damage_is_overlooked(tmp_path: Path, text: Path, damage: str | None) -> None:
    kept = tmp_path / "files.json"
    look(kept, text)
    if damage is None:  # a finding of another type
        content = json.loads(kept.read_text())
        content["known"] = {name: [state, 1] for name, (state, _) in content["known"].items()}
        damage = json.dumps(content)
    kept.write_text(damage)
    assert look(kept, text) == ["read", "old"]
    assert look(kept, text) == ["old"]


def test_where_nothing_can_be_kept_it_works_all_the_same(tmp_path: Path, text: Path) -> None:
    (tmp_path / "caches").touch()
    for _ in range(2):
        assert look(tmp_path / "caches" / "files.json", text) == ["read", "old"]
