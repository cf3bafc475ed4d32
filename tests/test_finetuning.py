"""A base checkpoint remembers the speech features it was trained with, and their weights."""

from dataclasses import replace
from pathlib import Path

import pytest

from dfrf import checkpoint, presets
from dfrf.model import Model
from dubbing import features
from dubbing.errors import CheckpointError
from dubbing.finetuning import FinetuneSettings, init_from_base

RNN = FinetuneSettings(speech="rnn")


@pytest.fixture
def base(tmp_path: Path) -> Path:
    dim = features.features_by_name("rnn").dim
    model = presets.build(presets.model_config("fast", dim))
    checkpoint.save_model(tmp_path / "base.safetensors", model, RNN.heard_with())
    return tmp_path / "base.safetensors"


def test_a_base_starts_a_person_with_the_same_features(base: Path) -> None:
    model = init_from_base(base, RNN)
    assert isinstance(model, Model)
    assert model.config.field.speech_dim == features.features_by_name("rnn").dim


def test_other_features_are_refused(base: Path) -> None:
    with pytest.raises(CheckpointError, match="'rnn' speech, asked for 'mel'"):
        init_from_base(base, replace(RNN, speech="mel"))


def test_other_weights_of_the_features_are_refused(
    base: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(features, "fingerprint", lambda name, weights=None: "another")
    with pytest.raises(CheckpointError, match="other weights"):
        init_from_base(base, RNN)
