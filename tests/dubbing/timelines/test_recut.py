"""A cut through a batch, and a new cut of the same films: what of it is made again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile
from typer.testing import CliRunner

from dubbing.batch import jobs
from dubbing.cli.main import app
from dubbing.engine.planning import planner
from dubbing.manifest.manifest import load
from dubbing.script.timecode import timecode_of
from tests import clips, fakes
from tests.dubbing.batches import dub
from tests.dubbing.timelines import cuts
from tests.dubbing.timelines.cuts import Piece, otio

pytestmark = pytest.mark.medium

RATE = Fraction(25)
FRAMES = 70  # of a film
EACH = 1920  # samples of a frame
# Of a film, the frames first .. stop.
CUT = [(0, 10, 25), (1, 12, 30), (0, 30, 45), (1, 36, 52)]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Two films with timecode, cut, and dubbed once."""
    folder = tmp_path_factory.mktemp("cut")
    with pytest.MonkeyPatch.context() as patch:
        fakes.install(patch.setattr)
        for film in range(2):
            raw, start = folder / f"raw{film}.mov", cuts.start_of(film, RATE)
            clips.write_clip(raw, FRAMES)
            target = folder / f"shot{film}.mov"
            clips.ffmpeg("-i", raw, "-c", "copy", "-timecode", timecode_of(start, RATE), target)
            raw.unlink()
        init(folder, CUT)
        path = folder / "manifest.yaml"
        text = path.read_text().replace('{by: "", reference: ""}', clips.CONSENT)
        path.write_text(text.replace("seconds: 15", "seconds: 1"))
        assert dub(path)[0].code == 0
        yield folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(made, tmp_path / "copy"))


def init(folder: Path, parts: list[tuple[int, int, int]]) -> str:
    """Write the manifest of a cut, in which every frame of a film has speech of its own."""
    pieces, at, sound = [], 0, []
    for film, first, stop in parts:
        pieces.append(Piece(film, first, stop, at))
        at += stop - first
        voice = np.random.default_rng(film).normal(size=FRAMES * EACH) * 0.05
        sound.append(voice[first * EACH : stop * EACH])
    soundfile.write(folder / "cut_it.wav", np.concatenate(sound), 48000, "PCM_24")
    cuts.write(folder / "cut.edl", pieces, RATE)
    call = ["init", str(folder), "--timeline", str(folder / "cut.edl"), "--handles", "4"]
    result = CliRunner().invoke(app, call)
    assert result.exit_code == 0, result.output
    return result.output


def kept(folder: Path) -> float:
    """Share of the stages that are up to date."""
    rows = planner.rows(jobs.build(load(folder / "manifest.yaml")), ())
    return float(np.mean([row.state == planner.UP_TO_DATE for row in rows]))


def test_the_cut_comes_back_with_the_dubs_above(folder: Path) -> None:
    timeline = otio.adapters.read_from_file(str(folder / "out" / "cut.dubbed.otio"))
    below, above = timeline.video_tracks()
    assert [clip.source_range for clip in above] == [clip.source_range for clip in below]
    assert all(Path(clip.media_reference.target_url[7:]).is_file() for clip in above)
    assert [len(clip.markers) for clip in above] == [1] * 4  # the verdict of each line
    assert "* FROM CLIP NAME:  shot0_000006.mp4" in (folder / "out" / "cut.dubbed.edl").read_text()
    # Its own files are made again without a word, somebody else's are not.
    result, began = dub(folder / "manifest.yaml")
    assert (result.code, began) == (0, [])
    ledger = folder / "out" / "work" / "results.json"
    known = json.loads(ledger.read_text())
    ledger.write_text(json.dumps({k: v for k, v in known.items() if "dubbed" not in k}))
    result, _ = dub(folder / "manifest.yaml")
    assert result.code == 1
    assert "was not made by this tool" in str(result.timelines[0])


def test_of_clips_that_moved_every_stage_is_kept(folder: Path) -> None:
    said = init(folder, [CUT[2], CUT[3], CUT[0], CUT[1]])
    assert "4 of 4 events lie in dubs that were there" in said
    assert kept(folder) == 1


def test_of_clips_that_were_trimmed_every_stage_is_kept(folder: Path) -> None:
    init(folder, [(film, first + 3, stop - 2) for film, first, stop in CUT])
    assert kept(folder) == 1


def test_only_a_new_clip_is_made(folder: Path) -> None:
    said = init(folder, [*CUT, (0, 50, 65)])
    assert "new: event 005 at 01:00:02:14 (shot0.mov): shot0_000046" in said
    rows = planner.rows(jobs.build(load(folder / "manifest.yaml")), ())
    new = {row.job.name for row in rows if row.state != planner.UP_TO_DATE}
    assert new == {"shot0_000046"}


def test_a_frame_more_than_the_handles_is_a_new_dub(folder: Path) -> None:
    init(folder, [(0, 5, 25), *CUT[1:]])
    rows = planner.rows(jobs.build(load(folder / "manifest.yaml")), ())
    people = [row for row in rows if row.job.name == "person"]
    assert all(row.state == planner.UP_TO_DATE for row in people)  # films and models stay
    assert kept(folder) == pytest.approx(1 - 4 / len(rows))


def test_plan_says_which_events_have_no_dub(folder: Path) -> None:
    path = folder / "manifest.yaml"
    rows = path.read_text().splitlines()
    path.write_text("\n".join(row for row in rows if "shot1_000008" not in row) + "\n")
    result = CliRunner().invoke(app, ["plan", str(path), "--json"])
    assert "cut.edl: no dub for 1 of 4 events" in json.loads(result.output)["warnings"]
    (folder / "cut.edl").unlink()
    result = CliRunner().invoke(app, ["plan", str(path)])
    assert "timeline: no such file" in result.output + str(result.exception)
