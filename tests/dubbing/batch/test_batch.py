from __future__ import annotations

import json
from pathlib import Path

import pytest

from dubbing import media
from dubbing.errors import ExplainedError
from tests import clips
from tests.dubbing.batches import dub, manifest_of

pytestmark = [pytest.mark.medium, pytest.mark.usefixtures("stand_ins")]


def test_a_dub_from_end_to_end(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    result, began = dub(path)
    assert result.code == 0
    expected = (
        "ann:prepare ann:check_source ann:finetune ann:refine_poses "
        "ann_it:listen ann_it:render ann_it:composite ann_it:check"
    )
    assert began == expected.split()
    out = tmp_path / "out"
    info = media.probe(out / "ann_it.mp4")
    # 1.6 s at 25 are 40 frames; the clip has 30, so the poses bounce.
    assert media.count_frames(out / "ann_it.mp4") == 40
    assert info.audio_rate == 48000
    shown = [clips.number(frame) for frame in media.read_frames(out / "ann_it.mp4")]
    assert shown == [*range(30), *range(28, 18, -1)]
    assert json.loads((out / "ann_it.sync.json").read_text())["verdict"] == "pass"
    report = json.loads((out / "report.json").read_text())
    assert report["dubs"]["ann_it"]["state"] == "made"
    assert report["identities"]["ann"]["consent"]["reference"] == "form 17"
    assert report["identities"]["ann"]["loss"] == [0.5, 0.25]
    page = (out / "report.html").read_text()
    assert "<h1>1 dub: 1 in sync</h1>" in page
    assert '"video": "ann_it.mp4"' in page
    assert report["dubs"]["ann_it"]["verdict"] == "passed"
    source = out / report["dubs"]["ann_it"]["source"]  # it is shown from where it lies
    assert source.samefile(footage / "ann.mp4")


def test_the_report_shows_the_codec_that_was_requested(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    path.write_text(path.read_text().replace("it.wav}", "it.wav, codec: ffv1}"))
    dub(path)
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["dubs"]["ann_it"]["video"] == "ann_it.proxy.mp4"  # what a browser plays
    assert (tmp_path / "out" / "ann_it.mkv").is_file()
    assert (tmp_path / "out" / "ann_it.mp4").is_file()  # whoever put it there may want it


def test_consent_is_in_the_record_of_a_dub(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    record = tmp_path / "out" / "work" / "dubs" / "ann_it" / "composite" / "stage.json"
    dub(path)
    consent = json.loads(record.read_text())["parameters"]["consent"]
    assert consent == {"by": "the person on film", "date": None, "reference": "form 17"}
    path.write_text(path.read_text().replace("form 17", "form 18"))
    _, began = dub(path)
    assert began == ["ann_it:composite"]
    assert json.loads(record.read_text())["parameters"]["consent"]["reference"] == "form 18"


def test_a_sync_check_that_falls_short(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", name: fellshort")
    result, _ = dub(path)
    assert result.code == 3
    assert (tmp_path / "out" / "fellshort.mp4").is_file()


def test_cut_ends_with_the_clip(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", on_longer_audio: cut")
    dub(path)
    assert media.count_frames(tmp_path / "out" / "ann_it.mp4") == 30


def test_only(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4", "bob": "bob.mp4"})
    result, began = dub(path, only=("bob_it",))
    assert {name.split(":")[0] for name in began} == {"bob", "bob_it"}
    assert result.code == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["dubs"]["ann_it"]["state"] == "not in this run"
    with pytest.raises(ExplainedError, match="nothing is called nobody"):
        dub(path, only=("nobody",))


def test_controls_and_markup_do_not_reach_the_page(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    path.write_text(path.read_text().replace("form 17", r"form <b> \e[31m\u202e"))
    dub(path)
    page = (tmp_path / "out" / "report.html").read_text()
    assert r"form \u003cb> \\x1b[31m\\u202e" in page
    assert "\x1b" not in page
