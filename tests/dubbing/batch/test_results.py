"""Whose results are, and that none is lost: the last one is kept, another's is never replaced."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from dubbing.batch import jobs, results
from dubbing.errors import ManifestError
from dubbing.manifest.manifest import load
from tests import clips, fakes
from tests.dubbing.batches import Listener, dub, manifest_of

pytestmark = pytest.mark.medium


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    fakes.install(monkeypatch.setattr)
    clips.write_clip(tmp_path / "ann.mp4", 30)
    clips.write_sound(tmp_path / "it.wav", 1.0)
    return manifest_of(tmp_path, tmp_path, {"ann": "ann.mp4"})


def again(path: Path, hertz: float) -> None:
    """Dubs with another recording."""
    clips.write_sound(path.parent / "it.wav", 1.0, hertz=hertz)
    assert dub(path)[0].code == 0


def warned(path: Path) -> list[str]:
    manifest = load(path)
    return [*results.warnings(manifest, manifest.dubs)]


def test_the_last_result_is_kept_beside_the_new_one(path: Path) -> None:
    out = path.parent / "out"
    dub(path)
    first, check = (out / "ann_it.mp4").read_bytes(), (out / "ann_it.sync.json").read_bytes()
    assert "ann_it.mp4 is made again; that of now is kept as ann_it.previous.mp4" in warned(path)[0]
    again(path, 500)
    second = (out / "ann_it.mp4").read_bytes()
    assert second != first
    assert (out / "ann_it.previous.mp4").read_bytes() == first
    assert (out / "ann_it.previous.sync.json").read_bytes() == check
    dub(path)  # nothing is made: nothing is replaced
    assert (out / "ann_it.previous.mp4").read_bytes() == first
    assert "in place of the one there" in warned(path)[0]
    again(path, 700)
    assert (out / "ann_it.previous.mp4").read_bytes() == second
    kinds = ("edl", "lines.csv", "lines.jsonl", "mp4", "sync.json")
    names = {f"ann_it.{previous}{kind}" for previous in ("", "previous.") for kind in kinds}
    assert {p.name for p in out.iterdir() if p.name.startswith("ann")} == names


@pytest.mark.parametrize("name", ["ann_it.mp4", "ann_it.sync.json", "ann_it.previous.mp4"])
def test_a_file_of_somebody_else_stays(path: Path, name: str) -> None:
    theirs = path.parent / "out" / name
    theirs.parent.mkdir()
    theirs.write_bytes(b"a year of work")
    listener = Listener()
    with pytest.raises(ManifestError, match=r"was not made by this tool.*move it away"):
        dub(path, listener=listener)
    assert (theirs.read_bytes(), listener.began) == (b"a year of work", [])
    theirs.unlink()
    assert dub(path)[0].code == 0


def test_a_video_that_was_exchanged_stays(path: Path) -> None:
    dub(path)
    video = path.parent / "out" / "ann_it.mp4"
    video.unlink()
    video.write_bytes(b"graded by hand")
    with pytest.raises(ManifestError, match="another file than was made"):
        dub(path)
    assert video.read_bytes() == b"graded by hand"


def test_a_file_that_comes_while_the_run_goes_on_stays(path: Path) -> None:
    theirs = path.parent / "out" / "ann_it.mp4"

    class Stranger(Listener):
        def overall(self, done: int, total: int) -> None:
            theirs.write_bytes(b"a year of work")

    result, _ = dub(path, listener=Stranger())
    failure = result.outcomes["dub/ann_it"].failure
    assert (result.code, failure is not None and failure.stage) == (1, "publish")
    assert theirs.read_bytes() == b"a year of work"


def test_a_result_of_another_manifest_is_named_and_stays(path: Path) -> None:
    dub(path)
    video = path.parent / "out" / "ann_it.mp4"
    first = video.read_bytes()
    other = path.with_name("b.yaml")
    other.write_text(path.read_text().replace("ann_it", "x").replace("it.wav", "it.wav"))
    clips.write_sound(path.parent / "it.wav", 1.0, hertz=600)
    with pytest.raises(ManifestError, match=r"is a result of .*m\.yaml"):
        dub(other)
    assert video.read_bytes() == first
    other.write_text(other.read_text().replace("}\n", "}\n").replace(".wav}", ".wav, name: b}"))
    assert "holds results of" in warned(other)[0]
    assert dub(other)[0].code == 0
    other.rename(path)  # the manifest was renamed: what it made is still its own
    assert dub(path)[0].code == 0


def test_results_of_a_version_that_kept_no_list_are_ours(path: Path) -> None:
    dub(path)
    (path.parent / "out" / "work" / results.LEDGER).unlink()
    again(path, 500)
    assert (path.parent / "out" / "ann_it.previous.mp4").is_file()
    shutil.rmtree(path.parent / "out" / "work")
    assert dub(path)[0].code == 0
    assert not jobs.build(load(path)).by_label["dub/ann_it"].blocked
