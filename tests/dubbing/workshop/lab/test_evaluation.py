"""What `evaluate` asks for before it learns anybody, and what it leaves behind."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import pytest

from dubbing.errors import ExplainedError, MediaError
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from dubbing.workshop.lab import evaluation, sync_figures, tiles
from dubbing.workshop.lab.held_out import frames_to_test
from dubbing.workshop.lab.variants import Variant
from tests import clips, fakes

pytestmark = pytest.mark.medium


FRAMES, LEARNED = 30, 20  # 0.8 s at 25 a second


@pytest.fixture
def manifest(tmp_path: Path) -> Production:
    clips.write_clip(tmp_path / "ann.mp4", FRAMES)
    path = tmp_path / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        f"  ann: {{clip: ann.mp4, seconds: 0.8, consent: {clips.CONSENT}}}\n"
    )
    return load(path)


@pytest.fixture(autouse=True)
def _stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are numbered frames; there is no face to listen to or to look at."""

    def measure(*arguments: object, **_: object) -> dict[str, float]:
        first, count, out = arguments[3:6]
        assert isinstance(out, Path)
        assert (first, count) == (LEARNED, FRAMES - LEARNED)
        for kind in ("render", "source"):
            clips.write_video(out / f"{kind}_picture.mp4", FRAMES - LEARNED)
        return {"psnr": 30.0}

    def measure_dub(*arguments: object, **_: object) -> dict[str, float]:
        parts, learned, out = arguments[3:6]
        assert isinstance(out, Path)
        assert (parts, learned) == ([(LEARNED, FRAMES - LEARNED)], [(0, LEARNED)])
        out.mkdir(parents=True)
        for kind in ("render", "source"):
            clips.write_video(out / f"{kind}_picture.mp4", FRAMES - LEARNED)
        return {"opening_r": 0.5}

    checked = SimpleNamespace(offset_frames=1, confidence=0.5, closeness=0.9)
    fakes.install(monkeypatch.setattr)
    monkeypatch.setattr(evaluation, "measure", measure)
    monkeypatch.setattr(evaluation, "measure_dub", measure_dub)
    monkeypatch.setattr(evaluation, "clip_speech", lambda *_: None)
    monkeypatch.setattr(evaluation, "offset_of", lambda _: 0)
    monkeypatch.setattr(sync_figures, "check", lambda _, source: checked)
    monkeypatch.setattr(tiles, "write_methods", lambda *_: None)


def quiet(_message: str, _share: float) -> None:
    pass


def test_figures_are_kept_and_the_render_says_that_it_is_generated(manifest: Production) -> None:
    found = evaluation.evaluate(manifest, device="cpu", progress=quiet)
    assert found["ann"]["dfrf"]["psnr"] == 30
    assert json.loads((manifest.output / evaluation.RESULT_FILE).read_text()) == found
    comments = {}
    for kind in ("render", "source"):
        with av.open(str(manifest.work / "evaluation" / "ann" / "dfrf" / f"{kind}.mp4")) as file:
            comments[kind] = file.metadata.get("comment", "")
    assert "AI-generated" in comments["render"]
    assert comments["source"] == ""


def test_the_figures_of_a_dub_stand_by_themselves(manifest: Production) -> None:
    found = evaluation.evaluate(manifest, device="cpu", progress=quiet)["ann"]["dfrf"]
    assert found["p15x"] == {
        "opening_r": 0.5,
        "offset_frames": 1,
        "confidence": 0.5,
        "closeness": 0.9,
        "source_offset_frames": 1,
        "source_confidence": 0.5,
    }
    dub = manifest.work / "evaluation" / "ann" / "dfrf" / "p15x" / "render.mp4"
    with av.open(str(dub)) as file:
        assert "AI-generated" in file.metadata["comment"]


def test_a_protocol_is_measured_alone(manifest: Production) -> None:
    def figures(protocol: str) -> set[str]:
        found = evaluation.evaluate(manifest, protocol=protocol, device="cpu", progress=quiet)
        return set(found["ann"]["dfrf"])

    assert figures("p15x") == {"p15x", "steps", "seconds"}
    # Of the same model, so the dub's figures stay.
    assert {"psnr", "confidence", "p15x"} <= figures("p15")
    with pytest.raises(ExplainedError, match=r"no protocol is called p16 \(--protocol\)"):
        figures("p16")


def test_what_a_dub_is_made_of_is_measured_where_that_is_asked_for(
    manifest: Production, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def composition(*arguments: object, **_: object) -> dict[str, float]:
        asked.append(arguments)
        return {"mouth crops": 0.8}

    monkeypatch.setattr(evaluation, "measure_composition", composition)

    def figures(composition: bool) -> dict[str, Any]:
        return evaluation.evaluate(
            manifest, protocol="p15", composition=composition, device="cpu", progress=quiet
        )["ann"]["dfrf"]

    assert "composition" not in figures(composition=False)
    found = figures(composition=True)
    assert found["composition"] == {"mouth crops": 0.8}
    assert "p15x" not in found
    ((_, _, _, parts, learned),) = asked
    assert parts
    assert learned


def test_of_another_model_no_figures_stay() -> None:
    before = {"psnr": 30.0, "flicker": 1.0, "frames": 9, "steps": 5, "seconds": 1.25, "p15x": {}}
    dub = {"p15x": {"opening_r": 0.5}, "steps": 5, "seconds": 1.25}
    pictures = {"psnr": 31.0, "frames": 3, "every": 3, "steps": 5, "seconds": 1.25}
    assert evaluation.merged(before, dub) == {**before, **dub}
    # What the pictures comments before is gone, flicker too.
    assert evaluation.merged(before, pictures) == {**pictures, "p15x": {}}
    learned_again = {**dub, "seconds": 1.5}
    assert evaluation.merged(before, learned_again) == learned_again


def test_frames_that_do_not_follow_one_another_have_no_sync_check(manifest: Production) -> None:
    found = evaluation.evaluate(manifest, protocol="p15", every=5, device="cpu", progress=quiet)[
        "ann"
    ]["dfrf"]
    assert found["every"] == 5
    assert "confidence" not in found


def test_before_anybody_is_learned_everybody_must_have_something_held_out(
    manifest: Production,
) -> None:
    ann = manifest.people["ann"]
    people = {"ann": ann, "all": replace(ann, name="all", seconds=1.2)}
    both = replace(manifest, people=people)
    with pytest.raises(
        ExplainedError, match=r"nothing of the clip is held out beside 1\.2 s \(all\)"
    ):
        evaluation.evaluate(both, device="cpu", progress=quiet)
    assert not manifest.output.exists()
    evaluation.evaluate(both, only=("ann",), device="cpu", progress=quiet)


def test_of_the_best_seconds_none_is_measured(manifest: Production) -> None:
    parts = [(0.2, 0.4), (0.8, 1.2)]  # frames 5 to 10 and 20 to 30
    tested = frames_to_test(manifest.people["ann"], parts, None, ("p15", "p15x"))
    assert tested.learned == [(5, 5), (20, 10)]
    assert tested.p15 == (10, 10)
    assert tested.p15x == [(10, 10), (0, 5)]
    best = replace(manifest.people["ann"], start=None, seconds=15.0)
    long = replace(manifest, people={"ann": best})
    with pytest.raises(ExplainedError, match="held out beside 15 s"):  # known before it is learned
        evaluation.evaluate(long, device="cpu", progress=quiet)


def test_a_damaged_clip_is_said(manifest: Production) -> None:
    ann = manifest.people["ann"]
    torn = (replace(ann.clip, info=None, damaged=MediaError("torn")),)
    damaged = replace(manifest, people={"ann": replace(ann, clips=torn, learned=torn)})
    with pytest.raises(MediaError, match="torn"):
        evaluation.evaluate(damaged, device="cpu", progress=quiet)


def test_a_variant_has_figures_and_a_model_of_its_own(manifest: Production) -> None:
    two = Variant("dfrf", references=2, warp=False)
    found = evaluation.evaluate(manifest, methods=(two,), device="cpu", progress=quiet)
    assert list(found["ann"]) == ["dfrf-2-nowarp"]
    assert (manifest.work / "evaluation" / "ann" / "dfrf-2-nowarp" / "render.mp4").is_file()
    stages = manifest.work / "identities" / "ann"
    assert [folder.name for folder in stages.glob("finetune*")] == ["finetune-dfrf-2-nowarp"]
    no_warp = Variant("ad-nerf", warp=False)
    with pytest.raises(
        ExplainedError, match=r"ad-nerf: preset 'ad-nerf' has no warp \(--no-warp\)"
    ):
        evaluation.evaluate(manifest, methods=(no_warp,), device="cpu", progress=quiet)
