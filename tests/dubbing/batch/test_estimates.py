"""What a run will need, from stages that were done."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dubbing.batch import jobs, rates
from dubbing.engine.graph.graph import nodes
from dubbing.engine.graph.stage import Rate
from dubbing.engine.planning import estimates, planner
from dubbing.engine.planning.estimates import Estimate
from dubbing.manifest.manifest import load
from dubbing.pipeline import STAGES
from dubbing.stages import KINDS
from dubbing.stages.base import PROCESS_BYTES
from dubbing.stages.finetune import Finetune
from dubbing.stages.render import Render
from tests import clips, fakes
from tests.dubbing.batches import dub, manifest_of

pytestmark = pytest.mark.medium


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A manifest of one person of 30 frames and one dub of 40."""
    fakes.install(monkeypatch.setattr)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    clips.write_clip(tmp_path / "ann.mp4", 30)
    clips.write_sound(tmp_path / "it.wav", 1.6)
    return manifest_of(tmp_path, tmp_path, {"ann": "ann.mp4"})


def needed(path: Path) -> Estimate:
    made = jobs.build(load(path))
    return estimates.estimate(made, planner.rows(made), rates.calibrated())


def amounts_of(path: Path) -> dict[str, float]:
    """Amounts by the names of stages."""
    return {str(name): n.stage.amount() for name, n in nodes(jobs.build(load(path))).items()}


# What a first dub took on two cores: a clip of 20 s, 15 s learned from, 10 s of speech, 512 px.
FIRST = {
    "prepare": 31,
    "check_source": 6,
    "finetune": 30,
    "refine_poses": 10,
    "listen": 1,
    "render": 12,
    "composite": 11,
    "check": 3,
}


def test_a_first_run_is_known_within_a_factor_of_two(path: Path) -> None:
    frames = {"prepare": 500, "check_source": 500, "refine_poses": 500, "listen": 10}
    found = {}
    for node in nodes(jobs.build(load(path))).values():
        stage, many = node.stage, float(frames.get(node.stage.kind, 250))
        if isinstance(stage, Finetune):
            many = replace(stage, crops=375.0).amount()
        found[stage.kind] = stage.typical.seconds * many
    assert found.keys() == FIRST.keys()
    for kind, seconds in FIRST.items():
        assert seconds / 1.5 < found[kind] < seconds * 1.5, kind
    needs = needed(path)
    assert needs.seconds > 0
    assert needs.memory > PROCESS_BYTES


def test_every_stage_has_a_rate_of_its_own() -> None:
    assert all("typical" in vars(stage) for stage in STAGES)


def test_what_was_made_of_something_else_says_nothing(path: Path) -> None:
    """A fine-tune of so many steps is no measure of one of others."""
    dub(path)
    graph = nodes(jobs.build(load(path)))
    assert set(estimates.measured(graph)) > {"finetune", "prepare", "render"}
    path.write_text(
        path.read_text().replace("seconds: 1,", "seconds: 1, finetune: {iterations: 9},")
    )
    clips.write_sound(path.parent / "it.wav", 0.8)
    graph = nodes(jobs.build(load(path)))
    found = estimates.measured(graph)
    assert "prepare" in found
    assert not {"finetune", "listen"} & set(found)


def test_the_slow_preset_has_rates_of_its_own(path: Path) -> None:
    quick = needed(path).seconds
    path.write_text(path.read_text().replace("seconds: 1,", "seconds: 1, preset: paper,"))
    assert needed(path).seconds > 1000 * quick


def test_a_calibration_is_used_and_finished_stages_refine_it(path: Path) -> None:
    rates.keep({name: Rate(1.0, 10.0) for name in KINDS})
    amounts = amounts_of(path)
    area = amounts["identity/ann/prepare"] / 30
    assert 0 < area < 1
    assert amounts["dub/ann_it/render ann_0000000-0000040"] == pytest.approx(40 * area)
    assert amounts["dub/ann_it/listen ann_0000000-0000040"] == pytest.approx(1.6)
    found = needed(path)
    assert found.seconds == pytest.approx(sum(amounts.values()))
    assert found.disk == pytest.approx(10 * sum(amounts.values()))
    assert found.longest <= found.two <= found.seconds
    # A stage that is done needs nothing, and says how fast its kind is here.
    dub(path)
    assert needed(path) == Estimate(0.0, 0.0, 0.0, 0.0, 0.0)
    (render,) = jobs.build(load(path)).by_label["dub/ann_it"].all_of(Render)
    record = render.folder / "stage.json"
    content = json.loads(record.read_text())
    record.write_text(json.dumps({**content, "seconds": 8.0}))
    path.write_text(path.read_text() + path.read_text().splitlines()[-1].replace("}", ", name: b}"))
    graph = nodes(jobs.build(load(path)))
    assert estimates.measured(graph)["render"].seconds == pytest.approx(8 / 40 / area)
    assert needed(path).seconds > 8


def test_ranges_of_a_long_dub_are_rendered_side_by_side(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rates.keep({**dict.fromkeys(KINDS, Rate(0.0)), "render": Rate(1.0, 10.0)})
    whole = needed(path)
    assert whole.seconds == whole.two == whole.longest > 0
    monkeypatch.setattr("dubbing.stages.render.PART", 10)  # of 40 frames
    parts = needed(path)
    assert parts.seconds == pytest.approx(whole.seconds)
    assert parts.disk == pytest.approx(whole.disk)
    assert parts.two == pytest.approx(whole.seconds / 2)
    assert parts.longest == pytest.approx(whole.seconds / 4)


def test_a_damaged_calibration_is_none(path: Path) -> None:
    rates.keep({"render": Rate(1.0, 1.0)})
    file = rates.rates_file()
    assert file is not None
    file.write_text("[3]")
    assert rates.calibrated() == {}


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
    amounts = amounts_of(path)
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
    rates.keep({name: Rate(1.0, 10.0) for name in KINDS})
    assert needed(path).seconds == pytest.approx(sum(amounts.values()))
