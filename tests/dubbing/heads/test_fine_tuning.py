"""A base checkpoint remembers the speech features it was trained with; poses are refined midway."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dfrf import presets, saved_models
from dfrf.cameras import project
from dfrf.config import TrainConfig
from dfrf.fast.fast_method import FastMethod
from dfrf.fast.fast_model import FastModel
from dfrf.field.mouth_pixels import region
from dfrf.training.progress import TrainingProgress
from dubbing.errors import CheckpointError, TrainingError
from dubbing.face.mouth.mouth_shape import LIPS
from dubbing.heads import fine_tuning as finetuning
from dubbing.heads.fine_tuning import learn
from dubbing.heads.initial_model import init_from_base, training_settings
from dubbing.identity.dataset import mean_face
from dubbing.identity.finetune_settings import FRONT_STEPS, TURNED_STEPS, FinetuneSettings
from dubbing.speech import features
from tests import clips, fakes
from tests.dfrf.people import person, small_config

pytestmark = pytest.mark.medium


RNN = FinetuneSettings(speech="rnn")


@pytest.fixture
def base(tmp_path: Path) -> Path:
    dim = features.features_by_name("rnn").dim
    model = presets.build(presets.model_config("fast", dim))
    saved_models.save_model(tmp_path / "base.safetensors", model, RNN.speech_header())
    return tmp_path / "base.safetensors"


def test_a_base_starts_a_person_with_the_same_features(base: Path) -> None:
    model = init_from_base(base, RNN)
    assert isinstance(model, FastModel)
    assert model.config.field.speech_dim == features.features_by_name("rnn").dim


def test_settings_of_a_fine_tune_take_the_place_of_the_presets() -> None:
    preset = presets.FINETUNE
    settings = FinetuneSettings(iterations=10, seed=3, learning_rate=1e-3, rays=64)
    own = training_settings(settings, preset, 10)
    assert own == replace(preset, iterations=10, seed=3, learning_rate=1e-3, rays=64)
    assert training_settings(FinetuneSettings(), preset, 9) == replace(preset, iterations=9)


def test_for_a_dub_a_head_that_does_not_turn_is_learned_from_half_of_the_rays() -> None:
    preset = presets.FINETUNE

    def rays(settings: FinetuneSettings, steps: int) -> tuple[int, int]:
        own = training_settings(settings, preset, steps)
        return own.rays, own.frames

    assert rays(FinetuneSettings(), FRONT_STEPS) == (preset.rays // 2, preset.frames // 2)
    assert rays(FinetuneSettings(rays=64), FRONT_STEPS)[0] == 64
    for settings, steps in (
        (FinetuneSettings(), TURNED_STEPS),
        (FinetuneSettings(iterations=FRONT_STEPS), FRONT_STEPS),
    ):
        assert rays(settings, steps) == (preset.rays, preset.frames)


def test_other_features_are_refused(base: Path) -> None:
    with pytest.raises(CheckpointError, match="'rnn' speech, wanted 'mel'"):
        init_from_base(base, replace(RNN, speech="mel"))


def test_other_weights_of_the_features_are_refused(
    base: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(features, "fingerprint", lambda name, weights=None: "another")
    with pytest.raises(CheckpointError, match="other weights"):
        init_from_base(base, RNN)


def test_a_person_can_be_learned_without_the_warp() -> None:
    model = init_from_base(None, replace(RNN, warp=False))
    assert not any(name.startswith("field.warp") for name in model.state_dict())


def footage_of(frames: range) -> Any:
    """Footage that shows some frames of a clip of its own."""
    return SimpleNamespace(clip=object(), with_face=np.array(frames))


def test_lips_are_measured_in_the_poses_that_were_refined(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A crop that is read where its head no longer is would show the mouth beside its place."""
    (tmp_path / "prepared").mkdir()
    path = clips.write_clip(tmp_path / "clip.mp4", 6)
    clip = fakes.write_prepared(path, tmp_path / "prepared")
    cameras = clip.c2w()
    cameras[:, 1, 3] += 0.2
    turned = clip.with_poses(cameras)
    monkeypatch.setattr(finetuning, "refined", lambda *of: turned)
    someone = person()
    footage: Any = SimpleNamespace(clip=clip, with_face=np.arange(6))
    config = TrainConfig(iterations=4, rays=64, frames=4)
    posed, _ = learn(
        presets.build(small_config()),
        someone,
        [footage],
        config,
        torch.tensor([0, 5]),
        tmp_path / "resume",
        "cpu",
        None,
    )
    place = region(mean_face(clip, LIPS))[0]
    unit = clip.focal / (posed.c2w[:, :, 3] - place).norm(dim=-1)[:, None, None]
    mean = project(
        mean_face(clip, LIPS), posed.c2w, float(clip.focal), torch.from_numpy(clip.centre).float()
    )
    seen = clip.landmarks[:, list(LIPS)]
    np.testing.assert_allclose(mean + posed.lip_points * unit, seen, atol=1e-2)


def test_poses_are_refined_after_a_quarter_of_the_steps_and_learned_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    someone = person()
    moved = someone.c2w.clone()
    moved[:, 0, 3] += 0.05
    seen: list[tuple[int, torch.Tensor, TrainConfig]] = []
    reports: list[TrainingProgress] = []
    fit = finetuning.fit

    def noted(model: Any, people: Any, config: TrainConfig, **named: Any) -> Any:
        curve = fit(model, people, config, **named)
        seen.append((len(curve.rows), people[0].c2w, config))
        return curve

    def refined(model: Any, maps: Any, clip: Any, frames: np.ndarray) -> Any:
        assert frames.tolist() == (first if clip is first.clip else second).with_face.tolist()
        assert len(seen) == 1
        return SimpleNamespace(c2w=moved.numpy)

    first, second = footage_of(range(4)), footage_of(range(4, someone.frames))

    monkeypatch.setattr(finetuning, "fit", noted)
    monkeypatch.setattr(finetuning, "refined", refined)
    monkeypatch.setattr(finetuning, "lip_points", lambda clip, frames: someone.lip_points[frames])
    config = TrainConfig(iterations=8, rays=64, frames=4, lip_iterations=2)
    references = torch.tensor([0, 5])
    model = presets.build(small_config())

    def run() -> tuple[torch.Tensor, list[int]]:
        posed, curve = learn(
            model, someone, [first, second], config, references, tmp_path, "cpu", reports.append
        )
        return posed.c2w, [row[0] for row in curve.rows]

    c2w, steps = run()
    assert [rows for rows, *_ in seen] == [2, 6]
    assert torch.equal(seen[0][1], someone.c2w)
    assert torch.equal(seen[1][1], moved)
    assert torch.equal(c2w, moved)
    # What lips do is learned from the sound, once.
    assert [c.lip_iterations for *_, c in seen] == [2, 0]
    assert steps == list(range(8))
    assert [(p.step, p.iterations) for p in reports] == [(k, 8) for k in range(1, 9)]
    assert all(p.seconds_left > 0 for p in reports[:-1])
    assert reports[-1].seconds_left == 0
    # A run that was killed before the model was written goes on from both states.
    seen.clear()
    reports.clear()
    assert run()[1] == steps
    assert not reports
    # One whose last state was damaged on the disk does those steps again.
    state = tmp_path / "state.safetensors"
    content = bytearray(state.read_bytes())
    content[-9] ^= 1
    state.write_bytes(content)
    seen.clear()
    assert run()[1] == steps
    assert reports


def test_a_model_that_refines_nothing_learns_in_one_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    someone = person()
    monkeypatch.setattr(FastMethod, "refines_poses", False)
    config = TrainConfig(iterations=4, rays=64, frames=4)
    model = presets.build(small_config(references=0, use_warp=False))
    posed, curve = learn(model, someone, [], config, None, tmp_path, "cpu", None)
    assert posed is someone
    assert len(curve.rows) == 4


@pytest.mark.parametrize(
    ("sound", "message"), [((), "has no sound"), (("-f", "lavfi", "-i", "anullsrc"), "is silent")]
)
def test_a_clip_without_a_voice_is_refused_at_once(
    tmp_path: Path, sound: tuple[str, ...], message: str
) -> None:
    film, clip = clips.write_video(tmp_path / "film.mp4", 5), tmp_path / "clip.mp4"
    clips.ffmpeg("-i", film, *sound, "-c:v", "copy", "-shortest", clip)
    prepared = fakes.write_prepared(clip, tmp_path / "prepared")
    with pytest.raises(TrainingError, match=message):
        finetuning.clip_speech(prepared, "mel")
