"""`preset: paper` from the manifest to the heads: what is said beforehand, bases, a person."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dfrf import presets, saved_models
from dfrf.config import PUBLISHED_SPEECH, ModelConfig
from dfrf.field.speaker_adaptation import NUMBERS
from dfrf.published import paper_method
from dfrf.published.conditioned_field import PaperConfig
from dfrf.published.paper_model import PaperModel
from dubbing.batch import jobs
from dubbing.errors import CheckpointError, ManifestError
from dubbing.heads import rendering as heads
from dubbing.heads.fine_tuning import finetune
from dubbing.heads.initial_model import init_from_base
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.identity.learned import MODEL_FILE, SUMMARY_FILE
from dubbing.manifest.checks import preset_checks as published
from dubbing.manifest.manifest import load
from dubbing.media import read_frames
from dubbing.pipeline import person_job
from dubbing.production.production import Production
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.stages.finetune import Finetune
from dubbing.stages.prepare import Prepare
from tests import clips, fakes
from tests.dfrf.people import small_config
from tests.dfrf.published.test_paper_method import TINY
from tests.dubbing.speech.deepspeech import graphs

pytestmark = pytest.mark.medium


PAPER = FinetuneSettings(preset="paper", iterations=4, speech="mel")


@pytest.fixture(autouse=True)
def _tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    """The published sizes and numbers of rays made small; everything else as it is."""
    real = presets.PRESETS["paper"]
    assert isinstance(real.sizes, PaperConfig)
    sizes = replace(TINY, slot_noise=real.sizes.slot_noise)
    trainings = presets.Trainings(
        **{
            name: replace(getattr(real.trainings, name), rays=40, frames=2)
            for name in ("base", "finetune", "from_scratch")
        }
    )
    monkeypatch.setitem(presets.PRESETS, "paper", presets.Preset(sizes, trainings))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("paper")
    clips.write_clip(found / "ann.mp4", 30)
    clips.write_sound(found / "it.wav", 1.6)
    return found


def manifest_of(folder: Path, keys: str = "") -> Production:
    text = f"""
version: 1
output: out
defaults: {{preset: paper, seconds: 1, speech: mel, size: 64}}
identities:
  ann: {{clip: ann.mp4, consent: {clips.CONSENT}{keys}}}
dubs:
  - {{identity: ann, audio: it.wav}}
"""
    path = folder / "manifest.yaml"
    path.write_text(text)
    return load(path)


def base_of(path: Path, config: ModelConfig | PaperConfig, speech: str = "mel") -> Path:
    torch.manual_seed(5)
    saved_models.save_model(path, presets.build(config), {"speech": speech})
    return path


def test_the_manifest_takes_it_and_reports_what_it_costs(folder: Path) -> None:
    production = manifest_of(folder)
    assert production.people["ann"].settings.preset == "paper"
    learn = jobs.build(production).by_label["identity/ann"].stage(Finetune)
    assert "base" not in learn.inputs
    message = "\n".join(production.warnings)
    assert "identities.ann: preset paper learns 40000 steps in about " in message
    assert "identities.ann: no base of preset paper comes with this tool" in message
    assert (
        "ann_it: preset paper renders 40 frames in about 12 minutes" in message
    )  # 1150 s / 64 each
    fast = manifest_of(folder, ", preset: fast")
    assert not any("paper" in warning for warning in fast.warnings)


def test_times_are_printed_in_fitting_units() -> None:
    minutes, hours, days = (published.lasts(60.0 * m) for m in (90, 240, 40 * 60 * 24))
    assert minutes.startswith("about 90 minutes")
    assert hours.startswith("about 4 hours")
    assert days.startswith("about 40 days")


def test_a_base_of_another_preset_is_a_mistake_in_the_manifest(folder: Path) -> None:
    fast = base_of(folder / "fast.safetensors", small_config())
    paper = base_of(folder / "paper.safetensors", replace(TINY, speech_dim=80))
    with pytest.raises(ManifestError, match=r"ann\.base: is a base of preset 'fast', but the iden"):
        manifest_of(folder, ", base: fast.safetensors")
    with pytest.raises(ManifestError, match=r"base: is a base of preset 'paper'.* preset 'nerf'"):
        manifest_of(folder, ", preset: nerf, base: paper.safetensors")
    warnings = manifest_of(folder, ", base: paper.safetensors").warnings
    assert sum("processor cores" in warning for warning in warnings) == 2  # the two times
    for base, preset in ((fast, "paper"), (paper, "fast")):
        with pytest.raises(CheckpointError, match=f"wanted '{preset}'"):
            init_from_base(base, replace(PAPER, preset=preset))


def test_a_base_gives_all_it_has_to_a_person(folder: Path) -> None:
    base = base_of(folder / "own.safetensors", replace(TINY, speech_dim=80))
    kept, _ = saved_models.load_model(base)
    model = init_from_base(base, PAPER)
    assert all(torch.equal(v, kept.state_dict()[n]) for n, v in model.state_dict().items())
    with pytest.raises(CheckpointError, match="'mel' speech, wanted 'rnn'"):
        init_from_base(base, replace(PAPER, speech="rnn"))


def test_an_imported_base_gives_all_but_the_layer_that_hears_deepspeech(folder: Path) -> None:
    config = replace(TINY, speech_dim=29)
    base = base_of(folder / "imported.safetensors", config, PUBLISHED_SPEECH)
    kept = saved_models.load_model(base)[0].state_dict()
    model = init_from_base(base, PAPER).state_dict()
    other = {n for n in kept if kept[n].shape != model[n].shape or not kept[n].equal(model[n])}
    assert other == {"audio.convolutions.0.weight"}
    assert model["audio.convolutions.0.weight"].shape[1] == 80
    warnings = manifest_of(folder, ", base: imported.safetensors").warnings
    assert any("imported.safetensors heard DeepSpeech features" in message for message in warnings)


def test_an_imported_base_hears_deepspeech_where_a_user_has_it(folder: Path) -> None:
    graph = graphs.write(folder / "output_graph.pb", graphs.weights())
    config = replace(TINY, speech_dim=29)
    base = base_of(folder / "imported.safetensors", config, PUBLISHED_SPEECH)
    heard = replace(PAPER, speech="deepspeech", speech_weights=str(graph))
    model = init_from_base(base, heard).state_dict()
    kept = saved_models.load_model(base)[0].state_dict()
    assert kept.keys() == model.keys()
    assert all(kept[name].equal(model[name]) for name in kept)
    keys = ", base: imported.safetensors, speech: deepspeech, speech_weights: output_graph.pb"
    assert not any("learned anew" in message for message in manifest_of(folder, keys).warnings)
    # A base of our own says by which weights it heard.
    digest = heard.speech_header()
    saved_models.save_model(base, saved_models.load_model(base)[0], digest)
    init_from_base(base, heard)
    graphs.write(graph, graphs.weights(seed=1))
    with pytest.raises(CheckpointError, match="other weights of the 'deepspeech' speech"):
        init_from_base(base, heard)


def test_a_person_is_learned_resumed_and_rendered(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared = tmp_path / "prepared"
    prepared.mkdir()
    clip = fakes.write_prepared(folder / "ann.mp4", prepared)
    random = np.random.default_rng(0)
    replace(clip, landmarks=random.random((30, 478, 2)) * 32).save()
    base = base_of(tmp_path / "base.safetensors", replace(TINY, speech_dim=80))
    out, again = tmp_path / "model", tmp_path / "again"
    settings = {"start": 0.0, "seconds": 1.0, "settings": PAPER, "base": base, "device": "cpu"}
    finetune([(clip, 0)], out, **settings)  # type: ignore[arg-type]

    # Killed after two steps, with a state kept after every one: it goes on to the same model.
    def stop(state: object) -> None:
        if getattr(state, "step", 0) == 3:
            raise KeyboardInterrupt

    tiny = presets.PRESETS["paper"]
    often = replace(tiny.trainings.finetune, checkpoint_every=1)
    trainings = replace(tiny.trainings, finetune=often)
    monkeypatch.setitem(presets.PRESETS, "paper", replace(tiny, trainings=trainings))
    with pytest.raises(KeyboardInterrupt):
        finetune([(clip, 0)], again, **settings, progress=stop)  # type: ignore[arg-type]
    assert (again / "resume" / "pictures").is_dir()
    finetune([(clip, 0)], again, **settings)  # type: ignore[arg-type]
    one, views, header = saved_models.load_person(out / MODEL_FILE)
    other, _, _ = saved_models.load_person(again / MODEL_FILE)
    assert isinstance(one, PaperModel)
    for name, value in one.state_dict().items():
        assert torch.equal(value, other.state_dict()[name]), name
    assert (header["speech"], header["steps"]) == ("mel", 4)
    assert views is not None
    assert views.images.shape == (4, 32, 32, 3)
    assert len((out / "loss.csv").read_text().splitlines()) == 5
    summary = json.loads((out / SUMMARY_FILE).read_text())
    assert summary["train"]["coarse_iterations"] == 0

    monkeypatch.setattr(paper_method, "RAYS_AT_ONCE", 300)
    windows = random.random((3, 16, 80)).astype(np.float32)
    heads.render(
        out / MODEL_FILE,
        clip,
        lambda first, count: SpeechFrames(
            windows[first : first + count], np.zeros((count, NUMBERS))
        ),
        tmp_path / "heads",
        pose_index=np.array([4, 5, 6]),
        device="cpu",
    )
    files = sorted((tmp_path / "heads").glob("*.mkv"))
    assert [file.name for file in files] == [f"00000{k}.mkv" for k in range(3)]
    pictures = [p for file in files for p in read_frames(file, pixels="rgba")]
    assert [p.shape for p in pictures] == [(32, 32, 4)] * 3
    assert max(p[..., 3].max() for p in pictures) > 4  # a haze, so early


def test_from_nothing_the_coarse_stage_comes_first(folder: Path, tmp_path: Path) -> None:
    prepared = tmp_path / "prepared"
    prepared.mkdir()
    clip = fakes.write_prepared(folder / "ann.mp4", prepared)
    replace(clip, landmarks=np.random.default_rng(0).random((30, 478, 2)) * 32).save()
    finetune([(clip, 0)], tmp_path, start=0.0, seconds=1.0, settings=PAPER, base=None, device="cpu")
    train = json.loads((tmp_path / SUMMARY_FILE).read_text())["train"]
    assert (train["iterations"], train["coarse_iterations"]) == (4, 3)
    assert train["lip_iterations"] == 0


def test_the_stage_asks_for_the_steps_of_the_preset(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dubbing.heads import fine_tuning as finetuning

    fitted: list[FinetuneSettings] = []
    monkeypatch.setattr(finetuning, "finetune", lambda *_, settings, **__: fitted.append(settings))
    person = manifest_of(folder).people["ann"]
    job = person_job(person, tmp_path, device="cpu")
    prepared = job.stage(Prepare).folder
    prepared.mkdir(parents=True)
    fakes.write_prepared(person.clip.path, prepared)
    job.stage(Finetune).run(tmp_path, lambda _message, _share: None)
    assert (fitted[0].preset, fitted[0].steps(from_base=True)) == ("paper", 40_000)
    assert presets.trainings("paper").finetune.iterations == 40_000
