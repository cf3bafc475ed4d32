"""A user's own HuBERT: a tiny random one on disk, and what is said when something is missing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing.errors import ExplainedError
from dubbing.speech import voice_activity as voice
from dubbing.speech.features import features_by_name, fingerprint, weights_file
from tests.dubbing.speech.test_voice_activity import pieces, silence
from tests.dubbing.workshop.training.speech.made import spoken

pytestmark = pytest.mark.medium


def tiny(name: str, made: Path) -> Path:
    """A random model of a few values, written as a user's would be."""
    transformers: Any = pytest.importorskip("transformers", reason="the extra is not installed")
    import torch

    torch.manual_seed(0)
    kind = {"hubert": "Hubert", "wav2vec2": "Wav2Vec2"}[name]
    config = getattr(transformers, f"{kind}Config")(
        hidden_size=16,
        num_hidden_layers=1,
        num_attention_heads=2,
        intermediate_size=16,
        conv_dim=[8] * 7,
        num_conv_pos_embeddings=16,
        num_conv_pos_embedding_groups=2,
    )
    getattr(transformers, f"{kind}Model")(config).save_pretrained(made)
    return made


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny("hubert", tmp_path_factory.mktemp("hubert"))


def test_wav2vec2_is_heard_alike(tmp_path: Path) -> None:
    sound = spoken().samples
    found = features_by_name("wav2vec2", tiny("wav2vec2", tmp_path)).extract(sound)
    assert found.shape == (voice.steps(len(sound)), 16)
    assert np.isfinite(found).all()


def test_features_of_a_folder(folder: Path) -> None:
    hubert = features_by_name("hubert", folder)
    sound = np.concatenate([spoken().samples, silence(2), spoken().samples])
    found = hubert.extract(sound)
    assert (hubert.name, hubert.dim) == ("hubert", 16)
    assert found.shape == (voice.steps(len(sound)), 16)
    pause = voice.steps(len(spoken().samples))
    assert (found[pause + 20 : pause + 80] == 0).all()
    assert np.abs(found[10 : pause - 10]).min(0).max() > 0
    assert hubert.extract(np.zeros(0, np.float32)).shape == (0, 16)
    assert hubert.extract(sound[:1000]).shape == (4, 16)


def test_long_sounds_are_heard_in_pieces(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.speech import transformer_features as pretrained

    hubert = features_by_name("hubert", folder)
    sound = spoken("a long line about the seven yellow moons over my home").samples
    whole = hubert.extract(sound)
    monkeypatch.setattr(pretrained, "PIECE", 40)
    monkeypatch.setattr(pretrained, "AROUND", 30)
    parts = hubert.extract_blocks(lambda: pieces(sound, (1, 9000, 321)))
    assert parts.shape == whole.shape
    alike = (whole * parts).sum() / np.sqrt((whole**2).sum() * (parts**2).sum())
    assert alike > 0.95


def test_other_weights_have_another_fingerprint(folder: Path, tmp_path: Path) -> None:
    file = weights_file("hubert", folder)
    assert file is not None
    (tmp_path / "config.json").write_bytes((folder / "config.json").read_bytes())
    changed = bytearray(file.read_bytes())
    changed[-1] ^= 1
    (tmp_path / file.name).write_bytes(changed)
    assert fingerprint("hubert", folder) != fingerprint("hubert", tmp_path)


def test_another_kind_of_model_is_refused(folder: Path) -> None:
    with pytest.raises(ExplainedError, match="'hubert', not 'wav2vec2'"):
        features_by_name("wav2vec2", folder)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ExplainedError, match=r"no hubert weights there.*nowhere"):
        features_by_name("hubert", tmp_path / "nowhere")
    with pytest.raises(ExplainedError, match="speech_weights"):
        features_by_name("hubert")


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "config.json").write_text('{"model_type": "hubert"}')
    (tmp_path / "model.safetensors").write_bytes(b"")
    monkeypatch.setitem(__import__("sys").modules, "transformers", None)
    with pytest.raises(ExplainedError, match="pip install 'transformers>=5'"):
        features_by_name("hubert", tmp_path)


def test_weights_with_which_features_depend() -> None:
    assert weights_file("mel") is None
    assert fingerprint("mel") == ""
    assert len(fingerprint("rnn")) > 16
