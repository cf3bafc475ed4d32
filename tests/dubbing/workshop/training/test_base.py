"""The base: who is learned from, who is held out, and what is written."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from dfrf import presets
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.fast.fast_model import FastModel
from dfrf.method_interface import Method
from dfrf.saved_models import load_model
from dfrf.training import fit as training
from dfrf.training.progress import Curve
from dfrf.training.validation import HeldOutRays
from dubbing.errors import CheckpointError, ExplainedError
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from dubbing.workshop.training import base as basetraining
from tests import clips
from tests.dfrf.people import person, small_config

pytestmark = pytest.mark.medium


NAMES = ("ann", "bob", "cy")
# Of the only person held out, every two steps; the warp learns from the twelfth on.
PSNR = [30.0, 30.0, 30.0, 30.0, 30.0, 20.0, 26.0, 24.0]


@pytest.fixture
def manifest(tmp_path: Path) -> Production:
    clips.write_clip(tmp_path / "clip.mp4", 30)
    people = "\n".join(
        f"  {name}: {{clip: clip.mp4, seconds: 1, consent: {{by: me, reference: form}}}}"
        for name in NAMES
    )
    path = tmp_path / "m.yaml"
    path.write_text(f"version: 1\noutput: out\nidentities:\n{people}\n")
    return load(path)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiny people and a tiny model."""

    def load_person(_: Production, name: str, *__: object) -> HeadDataset:
        return replace(person(seed=NAMES.index(name)), name=name)

    marks = iter(PSNR)
    config = TrainConfig(rays=96, frames=2, checkpoint_every=2, patience=2, augment=True)
    fast = presets.PRESETS["fast"]
    trained = replace(fast, trainings=replace(fast.trainings, base=config))
    monkeypatch.setitem(presets.PRESETS, "fast", trained)
    monkeypatch.setattr(basetraining, "load_person", load_person)
    monkeypatch.setattr(basetraining, "init_from_base", lambda *_: presets.build(small_config()))
    monkeypatch.setattr(HeldOutRays, "psnr", lambda *_: next(marks))


@pytest.mark.usefixtures("small")
def test_the_model_that_serves_who_is_held_out_best_is_written(
    manifest: Production, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    best: dict[str, torch.Tensor] = {}
    last: dict[str, torch.Tensor] = {}

    def fit(
        method: Method[Any, Any],
        people: list[HeadDataset],
        config: TrainConfig,
        options: training.FitOptions,
    ) -> Curve:
        curve = training.fit(method, people, config, options=options)
        assert options.validation is not None
        best.update(options.validation.best)
        last.update({name: v.clone() for name, v in method.model.state_dict().items()})
        return curve

    monkeypatch.setattr(basetraining, "fit", fit)
    out = tmp_path / "base.safetensors"
    basetraining.train_base(
        manifest, out, device="cpu", iterations=16, hold_out=("bob",), progress=lambda *_: None
    )
    history = json.loads(out.with_suffix(".json").read_text())
    assert history["identities"] == ["ann", "cy"]
    assert history["held_out"] == {"bob": 26.0}
    assert history["steps"] == 14
    rows = list(csv.reader((tmp_path / "base.held_out.csv").open()))
    assert rows == [["step", "bob"], *([str(2 * k + 2), str(p)] for k, p in enumerate(PSNR))]
    assert len((tmp_path / "base.csv").read_text().splitlines()) == 1 + 16
    model, _ = load_model(out)
    assert all(torch.equal(value, best[name]) for name, value in model.state_dict().items())
    assert any(not torch.equal(value, last[name]) for name, value in model.state_dict().items())


@pytest.mark.usefixtures("small")
def test_with_nobody_held_out_the_last_model_is_written(
    manifest: Production, tmp_path: Path
) -> None:
    out = tmp_path / "base.safetensors"
    basetraining.train_base(manifest, out, device="cpu", iterations=3, progress=lambda *_: None)
    history = json.loads(out.with_suffix(".json").read_text())
    assert history["identities"] == list(NAMES)
    assert history["steps"] == 3
    assert "held_out" not in history
    assert not (tmp_path / "base.held_out.csv").exists()
    # The next run begins afresh, whoever it learns from.
    assert not (tmp_path / "base.safetensors.resume").exists()


@pytest.mark.usefixtures("small")
def test_the_preset_of_a_base_can_be_another_than_the_manifests(
    manifest: Production, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[FinetuneSettings] = []

    def init_from_base(_: Path | None, settings: FinetuneSettings) -> FastModel:
        made.append(settings)
        return presets.build(small_config(lip_supervision=False))

    monkeypatch.setattr(basetraining, "init_from_base", init_from_base)
    out = tmp_path / "base.safetensors"
    basetraining.train_base(
        manifest, out, device="cpu", iterations=2, preset="fast-paper", progress=lambda *_: None
    )
    assert [settings.preset for settings in made] == ["fast-paper"]
    assert load_model(out)[0].state_dict()["field.warp.out.bias"].shape == (2,)


@pytest.mark.usefixtures("small")
def test_an_unfinished_run_goes_on_with_the_same_people_and_settings_only(
    manifest: Production, tmp_path: Path
) -> None:
    def train(
        who: Production, iterations: int = 6, stop_at: float = 1.0, **options: Any
    ) -> list[float]:
        shares: list[float] = []

        def progress(_message: str, share: float) -> None:
            shares.append(share)
            if stop_at <= share < 1:
                raise KeyboardInterrupt

        out = tmp_path / "base.safetensors"
        basetraining.train_base(
            who, out, device="cpu", iterations=iterations, progress=progress, **options
        )
        return shares

    with pytest.raises(KeyboardInterrupt):
        train(manifest, stop_at=0.5)  # the state after two steps is kept
    (init := tmp_path / "init.safetensors").write_bytes(b"another start")
    clips.write_clip(tmp_path / "other.mp4", 31)
    bob = manifest.people["bob"]
    clip = (replace(bob.clip, path=tmp_path / "other.mp4"),)
    other = replace(bob, clips=clip, learned=clip)
    swapped = replace(manifest, people={**manifest.people, "bob": other})
    for expected, who, options in (
        ("training", manifest, {"iterations": 8}),
        ("people held out, people", manifest, {"hold_out": ("bob",)}),
        ("people", swapped, {}),
        ("init", manifest, {"init": init}),
    ):
        with pytest.raises(CheckpointError, match=rf"settings \({expected}\).* remove .*\.resume"):
            train(who, **options)
    assert train(manifest) == pytest.approx([k / 6 for k in (3, 4, 5, 6)])


@pytest.mark.parametrize(("held", "message"), [(("dee",), "dee"), (NAMES, "everyone")])
def test_who_can_be_held_out(manifest: Production, held: tuple[str, ...], message: str) -> None:
    with pytest.raises(ExplainedError, match=message):
        basetraining.learned_names(manifest, held)
