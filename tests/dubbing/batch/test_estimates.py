"""What a run will need, from stages that were done."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dubbing.batch import batch, estimates, jobs
from dubbing.batch.estimates import Estimate, Rate
from dubbing.engine import planner
from dubbing.engine.graph import nodes
from dubbing.manifest.manifest import load
from tests import clips, fakes
from tests.dubbing.batches import Listener, manifest_of

STAGES = ("prepare", "check_source", "finetune", "refine_poses", "listen", "render")


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A manifest of one person of 30 frames and one dub of 40."""
    fakes.install(monkeypatch.setattr)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    clips.write_clip(tmp_path / "ann.mp4", 30)
    clips.write_sound(tmp_path / "it.wav", 1.6)
    return manifest_of(tmp_path, tmp_path, {"ann": "ann.mp4"})


def needed(path: Path) -> Estimate:
    manifest = load(path)
    made = jobs.build(manifest)
    return estimates.estimate(manifest, made, planner.rows(made))


def test_nothing_is_reported_that_nobody_measured(path: Path) -> None:
    found = needed(path)
    assert found.seconds == 0
    assert set(STAGES) < set(found.unknown)
    assert found.memory > estimates.HELD


def test_a_calibration_is_used_and_finished_stages_refine_it(path: Path) -> None:
    names = [*needed(path).unknown]
    estimates.keep({name: Rate(1.0, 10.0) for name in names})
    manifest = load(path)
    graph = nodes(jobs.build(manifest))
    amounts = {key: estimates.amount(manifest, node) for key, node in graph.items()}
    area = amounts["identity/ann/prepare"] / 30
    assert 0 < area < 1
    assert amounts["dub/ann_it/render"] == pytest.approx(40 * area)
    assert amounts["dub/ann_it/listen"] == pytest.approx(1.6)
    found = needed(path)
    assert found.seconds == pytest.approx(sum(amounts.values()))
    assert found.disk == pytest.approx(10 * sum(amounts.values()))
    assert found.longest <= found.two <= found.seconds
    # A stage that is done needs nothing, and says how fast its kind is here.
    batch.dub(manifest, Listener())
    assert needed(path) == Estimate(0.0, 0.0, 0.0, 0.0, 0.0, ())
    record = jobs.build(manifest).dubs["ann_it"].stages["render"].folder / "stage.json"
    content = json.loads(record.read_text())
    record.write_text(json.dumps({**content, "seconds": 8.0}))
    path.write_text(path.read_text() + path.read_text().splitlines()[-1].replace("}", ", name: b}"))
    assert estimates.measured(load(path), graph)["render"].seconds == pytest.approx(8 / 40 / area)
    render = 40 * area * 8 / 40 / area
    assert needed(path).seconds > render


def test_ranges_of_a_long_dub_are_rendered_side_by_side(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimates.keep({"render": Rate(1.0, 10.0)})
    whole = needed(path)
    assert whole.seconds == whole.two == whole.longest > 0
    monkeypatch.setattr("dubbing.tasks.dub.PART", 10)  # of 40 frames
    parts = needed(path)
    assert parts.seconds == pytest.approx(whole.seconds)
    assert parts.disk == pytest.approx(whole.disk)
    assert parts.two == pytest.approx(whole.seconds / 2)
    assert parts.longest == pytest.approx(whole.seconds / 4)


def test_a_damaged_calibration_is_none(path: Path) -> None:
    estimates.keep({"render": Rate(1.0, 1.0)})
    file = estimates.rates_file()
    assert file is not None
    file.write_text("[3]")
    assert estimates.calibrated() == {}


def test_a_scene_takes_as_long_as_its_lines_and_a_person_as_all_their_clips(path: Path) -> None:
    folder = path.parent
    clips.write_clip(folder / "two.mp4", 50)
    (folder / "it.srt").write_text(
        "1\n00:00:00,400 --> 00:00:00,800\nANN: One.\n\n"
        "2\n00:00:01,000 --> 00:00:01,200\nANN: Two.\n"
    )
    text = path.read_text().replace(f"clip: {folder}/ann.mp4", "clips: [ann.mp4, two.mp4]")
    text = text.replace("audio:", "clip: ann.mp4, audio:")
    scene = "clip: two.mp4, lines: it.srt, speakers: {ANN: ann}, audio: it.wav"
    path.write_text(f"{text}  - {{{scene}}}\n")
    manifest = load(path)
    graph = nodes(jobs.build(manifest))
    amounts = {key: estimates.amount(manifest, node) for key, node in graph.items()}
    area = amounts["identity/ann/prepare"] / 30
    for stage in ("prepare", "refine_poses"):
        assert amounts[f"identity/ann/{stage} two"] == pytest.approx(50 * area)
    assert amounts["identity/ann/check_source two"] == 50
    lines = {"ann_0000010-0000020": 10, "ann_0000025-0000030": 5}
    for name, frames in lines.items():
        assert amounts[f"dub/it/listen {name}"] == pytest.approx(frames / 25)
        assert amounts[f"dub/it/render {name}"] == pytest.approx(frames * area)
    assert amounts["dub/it/composite"] == 50
    assert amounts["dub/it/check"] == 15
    # What is not made yet is what the time is of: all of it.
    estimates.keep({name: Rate(1.0, 10.0) for name in needed(path).unknown})
    assert needed(path).seconds == pytest.approx(sum(amounts.values()))
