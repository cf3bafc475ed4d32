"""Where results go: files and folders that cannot be written, or must not be."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dubbing.cli import main as cli

pytestmark = pytest.mark.medium


def test_a_folder_that_cannot_be_made_is_reported(  # type: ignore[no-untyped-def]
    dfrf, manifest: Path, footage: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (manifest.parent / "file").touch()
    code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", manifest.parent / "file" / "out")
    assert code == 1
    assert "the folder cannot be made: Not a directory" in err
    # Whoever runs the tests may be allowed everything.
    closed = str(manifest.parent), str(footage)

    def access(path: str | Path, mode: int) -> bool:
        return not (mode & os.W_OK and str(path).startswith(closed))

    monkeypatch.setattr(os, "access", access)
    for arguments in (("dub", manifest), ("init", footage)):
        code, _, err = dfrf(*arguments)
        assert code == 1
        assert "nothing may be written there" in err


def test_a_file_that_cannot_be_written_is_refused_before_anything_is_trained(
    dfrf: Any, manifest: Path, footage: Path, tmp_path: Path
) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "file").write_text("")
    clip = footage / "ann.mp4"
    for call in (
        ("train-base", manifest, "--out"),
        ("train-sync", clip, "--out"),
        ("train-speech",),
    ):
        code, _, err = dfrf(*call, tmp_path / "taken")
        assert code == cli.FAILED
        assert "a folder, not a file to write" in err
        code, _, err = dfrf(*call, tmp_path / "file" / "net.safetensors")
        assert code == cli.FAILED
        assert "the folder cannot be made" in err


def in_a_process(*arguments: object, output: str) -> tuple[int, str]:
    """Exit code of a run whose output goes to a file, and what it said of errors."""
    with open(output, "w") as stream:
        done = subprocess.run(
            [
                sys.executable,
                "-c",
                "from dubbing.cli.main import main; main()",
                *map(str, arguments),
            ],
            stdout=stream,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    return done.returncode, done.stderr


@pytest.mark.parametrize("arguments", [["--help"], ["plan", "--json"], ["plan"]])
def test_output_that_cannot_be_written_is_1(manifest: Path, arguments: list[str]) -> None:
    path = [manifest] if arguments[0] == "plan" else []
    code, err = in_a_process(*arguments, *path, output="/dev/full")
    assert code == 1
    assert err == "dfrf: No space left on device: free some space, then run again\n"


@pytest.mark.parametrize("link", [None, os.link, os.symlink])
def test_a_checkpoint_is_not_imported_onto_itself(dfrf: Any, tmp_path: Path, link: Any) -> None:
    file = out = tmp_path / "head.tar"
    file.write_bytes(b"PK weights")
    if link:
        out = tmp_path / "out.safetensors"
        link(file, out)
    code, _, err = dfrf("import-checkpoint", file, out)
    assert code == 2
    assert "it is read, so it cannot be written" in err
    assert file.read_bytes() == b"PK weights"


def test_a_base_is_not_trained_onto_what_it_learns_from(
    dfrf: Any, manifest: Path, footage: Path
) -> None:
    for out in (manifest, footage / "ann.mp4"):
        code, _, err = dfrf("train-base", manifest, "--out", out)
        assert code == 2
        assert "it is read, so it cannot be written" in err
