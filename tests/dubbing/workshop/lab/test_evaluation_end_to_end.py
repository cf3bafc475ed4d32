"""A tiny person, never trained, evaluated by both protocols: all that evaluate.json must hold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dfrf import presets, saved_models
from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.cli import console
from dubbing.engine.disk.files import atomic_write_json
from dubbing.manifest.manifest import load
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.stages.check_source import CheckSource
from dubbing.stages.finetune import Finetune
from dubbing.stages.prepare import Prepare
from dubbing.workshop.lab import cross_driving, evaluation, measuring, sync_figures
from tests import clips, fakes
from tests.dfrf.people import small_config
from tests.dubbing.sync.meshes import talk
from tests.dubbing.workshop.lab.faces import show_faces

pytestmark = pytest.mark.medium


FRAMES, LEARNED = 30, 24
OF_LIPS = {
    *("lmd", "lip_rms", "opening_r", "width_r", "closure_f1", "closure_f1_near", "closure_mcc"),
    *("opening_ratio", "texture_ratio", "offset_frames", "confidence", "closeness", "frames"),
}
OF_PICTURES = {
    *("psnr", "ssim", "psnr_face", "psnr_mouth", "sharpness", "steps", "seconds", "p15x")
}


def prepare(self: Prepare, out: Path, _: object) -> None:
    random = np.random.default_rng(0)
    clip = fakes.write_prepared(self.clip, out)
    shape = np.concatenate([random.uniform(-0.8, 0.8, (478, 2)), np.zeros((478, 1))], 1)
    marks = 4 + random.random((len(clip), 478, 2)) * 24
    replace(clip, shape=shape, landmarks=marks).save()


def finetune(_self: Finetune, out: Path, _: object) -> None:
    model = presets.build(small_config(references=0, use_warp=False))
    saved_models.save_person(out / "model.safetensors", model, None, {})
    learned = [[0.0, LEARNED / 25]]
    summary = {"steps": 6, "seconds": 1.5, "clip": "", "learned": learned, "beside": []}
    atomic_write_json(out / "finetune.json", summary)


def test_both_protocols_of_a_tiny_person(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clips.write_clip(tmp_path / "ann.mp4", FRAMES)
    (tmp_path / "m.yaml").write_text(
        "version: 1\noutput: out\nidentities:\n"
        f"  ann: {{clip: ann.mp4, seconds: {LEARNED / 25},\n"
        f"    consent: {clips.CONSENT}}}\n"
    )
    gaps, wide = np.array([0.0, 0.1, 0.2, 0.05, 0.0, 0.15]), np.linspace(0.4, 0.6, 6)
    talks = [talk(gaps / 2, wide), talk(gaps, wide)]
    checked = SimpleNamespace(offset_frames=0, confidence=0.25, closeness=0.9)
    random = np.random.default_rng(1)
    monkeypatch.setattr(Prepare, "run", prepare)
    monkeypatch.setattr(Finetune, "run", finetune)
    monkeypatch.setattr(CheckSource, "run", lambda _, out, progress: None)
    monkeypatch.setattr(evaluation, "offset_of", lambda _: 0)
    speech = SpeechFrames(random.random((FRAMES, 16, 8)), random.random((FRAMES, NUMBERS)))
    monkeypatch.setattr(evaluation, "clip_speech", lambda *_: speech)
    monkeypatch.setattr(sync_figures, "check", lambda _, source: checked)
    show_faces(monkeypatch, measuring, talks, scale=16)
    show_faces(monkeypatch, cross_driving, talks, scale=16)
    manifest = load(tmp_path / "m.yaml")
    evaluation.evaluate(manifest, device="cpu", progress=lambda message, share: None)
    found = json.loads((manifest.output / "evaluate.json").read_text())["ann"]["dfrf"]
    assert set(found) >= OF_LIPS | OF_PICTURES
    assert set(found["p15x"]) >= OF_LIPS | {"chin_ratio"}
    for figures in (found, found["p15x"]):
        assert figures["frames"] == FRAMES - LEARNED
        assert figures["opening_ratio"] == pytest.approx(0.5, rel=0.01)
        assert figures["opening_r"] == pytest.approx(1)
        assert figures["width_r"] == pytest.approx(1)
        assert "measured: 6, and fewer than 50 say little" in figures["frames suspicion"]
    assert evaluation.few({"frames": 50}) == {}
    console.metrics({"ann": {"dfrf": found}})
    shown = " ".join(capsys.readouterr().out.split())
    assert "ann, dfrf: frames measured: 6" in shown
    assert "ann, dfrf: p15x frames measured: 6" in shown
    folder = manifest.work / "evaluation" / "ann" / "dfrf"
    for name in ("render.mp4", "frames.csv", "tiles.png"):
        assert (folder / name).is_file()
        assert (folder / "p15x" / name).is_file()
