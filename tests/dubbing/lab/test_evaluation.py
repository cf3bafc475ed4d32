"""What `evaluate` asks for before it learns anybody, and what it leaves behind."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import av
import pytest

from dubbing import jobs
from dubbing.errors import DubbingError, MediaError
from dubbing.lab import evaluation, tiles
from dubbing.manifest.manifest import Manifest, load
from dubbing.stages import steps
from tests import clips, fakes

CONSENT = '{by: "the person on film", reference: "form 17"}'
FRAMES, LEARNED = 30, 20  # 0.8 s at 25 a second


@pytest.fixture
def manifest(tmp_path: Path) -> Manifest:
    clips.write_clip(tmp_path / "ann.mp4", FRAMES)
    path = tmp_path / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        f"  ann: {{clip: ann.mp4, seconds: 0.8, consent: {CONSENT}}}\n"
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

    checked = SimpleNamespace(offset_frames=1, confidence=0.5)
    fakes.install(monkeypatch.setattr)
    monkeypatch.setattr(evaluation, "measure", measure)
    monkeypatch.setattr(evaluation, "clip_windows", lambda *_: None)
    monkeypatch.setattr(steps, "offset_of", lambda _: 0)
    monkeypatch.setattr(evaluation, "check", lambda _: checked)
    monkeypatch.setattr(tiles, "write_methods", lambda *_: None)


def quiet(_message: str, _share: float) -> None:
    pass


def test_figures_are_kept_and_the_render_says_that_it_is_generated(manifest: Manifest) -> None:
    found = evaluation.evaluate(manifest, device="cpu", progress=quiet)
    assert found["ann"]["dfrf"]["psnr"] == 30
    assert json.loads((manifest.output / evaluation.RESULT_FILE).read_text()) == found
    said = {}
    for kind in ("render", "source"):
        with av.open(str(manifest.work / "evaluation" / "ann" / "dfrf" / f"{kind}.mp4")) as file:
            said[kind] = file.metadata.get("comment", "")
    assert "AI-generated" in said["render"]
    assert said["source"] == ""


def test_before_anybody_is_learned_everybody_must_have_something_held_out(
    manifest: Manifest,
) -> None:
    ann = manifest.identities["ann"]
    people = {"ann": ann, "all": ann.model_copy(update={"seconds": 1.2})}
    both = manifest.model_copy(update={"identities": people})
    with pytest.raises(DubbingError, match=r"nothing of the clip is held out after 1\.2 s \(all\)"):
        evaluation.evaluate(both, device="cpu", progress=quiet)
    assert not manifest.output.exists()
    evaluation.evaluate(both, only=("ann",), device="cpu", progress=quiet)


def test_a_damaged_clip_is_said(manifest: Manifest) -> None:
    clip = manifest.identities["ann"].clip
    damaged = manifest.model_copy(update={"media": {}, "damaged": {clip: MediaError("torn")}})
    with pytest.raises(MediaError, match="torn"):
        evaluation.evaluate(damaged, device="cpu", progress=quiet)


def test_another_number_of_references_is_another_fine_tune(manifest: Manifest) -> None:
    job = jobs.identity_job(manifest, "ann", manifest.identities["ann"], "cpu")
    plain = job.stages["finetune"]
    two = evaluation.with_references(plain, evaluation.REFERENCES_OF_METHOD["dfrf-2"])
    assert two.key() != plain.key()
    assert isinstance(two.produce, steps.Finetune)
    assert two.produce.references == 2
    assert evaluation.PRESET_OF_METHOD["dfrf-2"] == "fast"
