"""A dub of an image sequence through a batch: its keys, its results, what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import ManifestError
from dubbing.manifest.manifest import load
from dubbing.media import probe
from tests import clips, fakes, sequences
from tests.dubbing.batches import dub

pytestmark = pytest.mark.medium

MANIFEST = """\
version: 1
output: out
identities:
  ann:
    clips: [ann.mp4, film/shot.####.exr]
    rate: 25
    colour: {{film: ACEScg}}
    seconds: 1
    consent: {consent}
dubs:
  - {{name: it, identity: ann, clip: film/shot.%04d.exr, audio: it.wav, {keys}}}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    fakes.install(monkeypatch.setattr)
    clips.write_clip(tmp_path / "ann.mp4", 30)
    clips.write_sound(tmp_path / "it.wav", 0.4)
    rng = np.random.default_rng(0)
    frames = [rng.uniform(0, 0.5, (48, 64, 3)).astype(np.float16) for _ in range(12)]
    sequences.write_sequence(tmp_path / "film" / "shot.####.exr", frames)
    return tmp_path


def manifest(folder: Path, keys: str) -> Path:
    path = folder / "m.yaml"
    path.write_text(MANIFEST.format(consent=clips.CONSENT, keys=keys))
    return path


def test_a_turnover_lies_beside_the_video(folder: Path) -> None:
    path = manifest(folder, "deliver: turnover")
    assert dub(path)[0].code == 0
    out = folder / "out"
    names = sorted(one.name for one in (out / "it.turnover").iterdir())
    assert names == ["over_the_film.nk", *(f"shot.{k}.exr" for k in range(1001, 1011))]
    assert (out / "it.mp4").is_file()
    report = json.loads((out / "report.json").read_text())["dubs"]["it"]
    assert (report["delivered"]["frames"], report["delivered"]["outside"]) == (10, 0)
    assert report["delivered"]["steps"] <= 1
    assert probe(out / report["source"]).frames == 12  # a copy that browsers play
    before = (out / "it.turnover" / "shot.1001.exr").stat().st_ino
    assert dub(path)[1] == []  # all of it is up to date
    assert (out / "it.turnover" / "shot.1001.exr").stat().st_ino == before


def test_the_last_turnover_is_kept_and_a_changed_frame_makes_a_new_one(folder: Path) -> None:
    path = manifest(folder, "deliver: turnover")
    dub(path)
    old = (folder / "out" / "it.turnover" / "shot.1001.exr").read_bytes()
    grey = np.full((48, 64, 3), 0.3, np.float16)
    sequences.write_image(folder / "film" / "shot.1001.exr", grey)
    assert dub(path)[0].code == 0
    assert (folder / "out" / "it.previous.turnover" / "shot.1001.exr").read_bytes() == old
    assert (folder / "out" / "it.turnover" / "shot.1001.exr").read_bytes() != old


def test_a_folder_of_somebody_else_stays(folder: Path) -> None:
    theirs = folder / "out" / "it.turnover"
    theirs.mkdir(parents=True)
    (theirs / "mine.txt").write_text("mine")
    result = dub(manifest(folder, "deliver: turnover"))[0]
    assert result.code == 1
    assert [one.name for one in theirs.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("deliver: turnover, frame: crop", "of whole frames"),
        ("deliver: turnover, audio: long.wav", "longer than the film"),
        ("deliver: turnover, clip: ann.mp4", "no image sequence"),
        ("deliver: layers", "deliver"),
    ],
)
def test_what_cannot_be_delivered(folder: Path, keys: str, words: str) -> None:
    clips.write_sound(folder / "long.wav", 2)
    text = manifest(folder, keys).read_text()
    for key in ("audio: it.wav, ", "clip: film/shot.%04d.exr, "):
        text = text.replace(key, "" if f", {key.split(':')[0]}:" in keys and key in text else key)
    (folder / "m.yaml").write_text(text)
    with pytest.raises(ManifestError, match=words):
        load(folder / "m.yaml")


def test_a_rate_is_for_sequences(folder: Path) -> None:
    text = manifest(folder, "codec: hevc").read_text().replace(", film/shot.####.exr", "")
    (folder / "m.yaml").write_text(text.replace("clip: film/shot.%04d.exr, ", ""))
    with pytest.raises(ManifestError, match="rate: is for image sequences"):
        load(folder / "m.yaml")


def test_missing_frames_block_the_dub_alone(folder: Path) -> None:
    (folder / "film" / "shot.1004.exr").unlink()
    production = load(manifest(folder, "deliver: turnover"))
    assert "frames are missing: 1004" in str(production.dubs["it"].blocked)
