"""The command `prepare`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from dubbing.engine.disk import claims
from tests import fakes


@pytest.fixture
def preparing(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Folders that `prepare` was called for; it leaves there what it would."""
    found: list[Path] = []

    def work(clip: Path, out: Path, **_: object) -> object:
        found.append(out)
        return fakes.write_prepared(clip, out)

    monkeypatch.setattr("dubbing.preparation.prepare.prepare", work)
    return found


def test_prepare_takes_an_empty_folder_or_its_own(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    clip, out = footage / "ann.mp4", tmp_path / "out"
    for _ in range(2):
        code, _, err = dfrf("prepare", clip, "--out", out)
        assert code == 0, err
    cut_short = tmp_path / "cut_short"
    (cut_short / "steps").mkdir(parents=True)
    (cut_short / "steps" / ".key.17.tmp.json").touch()
    assert dfrf("prepare", clip, "--out", cut_short)[0] == 0
    assert preparing == [out, out, cut_short]


def test_prepare_says_how_much_of_the_face_is_seen(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = footage / "ann.mp4"
    code, out, _ = dfrf("prepare", clip, "--out", tmp_path / "all")
    assert code == 0
    assert "ann.mp4: all frames show the face, head turned 0 degrees, tilted 0 degrees\n" in out

    def work(clip: Path, out: Path, **_: object) -> object:
        found = fakes.write_prepared(clip, out, invalid=(1, 2, 3))
        found.covered[5], found.over[6:12] = True, True
        return found

    monkeypatch.setattr("dubbing.preparation.prepare.prepare", work)
    _, out, _ = dfrf("prepare", clip, "--out", tmp_path / "some")
    assert "ann.mp4: 86 % of the frames show the face, head turned " in out
    assert (
        "14 % not: no face in 3 frames, covered in 1; something lies over the face in 20 %" in out
    )


@pytest.mark.parametrize("name", ["notes.txt", "steps/mine.txt", "matte.mkv"])
def test_prepare_refuses_a_folder_with_other_files(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path], name: str
) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("precious")
    code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", tmp_path)
    assert (code, preparing) == (2, [])
    assert "other files lie there" in err
    assert "name an empty folder" in err
    assert (tmp_path / name).read_text() == "precious"


def test_prepare_refuses_no_folder_and_its_own_clip(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", "")
    assert code == 2
    assert "names no folder (--out)" in err
    fakes.write_prepared(footage / "ann.mp4", tmp_path)
    code, _, err = dfrf("prepare", tmp_path / "matte.mkv", "--out", tmp_path)
    assert code == 2
    assert "the clip itself would be overwritten" in err
    assert preparing == []


def test_two_at_once_into_one_folder_are_2(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    with claims.hold(tmp_path / "prepare"):
        code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", tmp_path)
    assert (code, preparing) == (2, [])
    assert f"another run is at work ({tmp_path / 'prepare'}): wait for process {os.getpid()}" in err


def test_a_clip_whose_name_is_no_utf8_is_refused_before_it_is_prepared(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    clip = tmp_path / os.fsdecode(b"\xff.mp4")
    clip.write_bytes((footage / "ann.mp4").read_bytes())
    code, _, err = dfrf("prepare", clip)
    assert (code, preparing) == (2, [])
    assert "its name is no UTF-8: rename the file" in err
