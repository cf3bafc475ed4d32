"""What a published model hears: DeepSpeech's outputs in the published windows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import ExplainedError
from dubbing.speech import deepspeech_features
from dubbing.speech.deepspeech_features import DeepSpeechFeatures
from dubbing.speech.features import features_by_name, fingerprint, weights_file, windows
from tests.dubbing.speech.deepspeech import graphs
from tests.dubbing.speech.deepspeech.test_cepstra import literal as cepstra
from tests.dubbing.speech.deepspeech.test_deepspeech_network import literal as network
from tests.dubbing.speech.test_voice_activity import pieces, vowels

SOUND = vowels(1.5)[: 320 * 70 + 50]


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return graphs.write(tmp_path_factory.mktemp("graph") / "output_graph.pb", graphs.weights())


@pytest.fixture
def features(graph: Path) -> DeepSpeechFeatures:
    return DeepSpeechFeatures(graph)


def published(sound: np.ndarray) -> np.ndarray:
    """Outputs (T, 29) of a whole sound, as the published preparation makes them."""
    found = cepstra(sound)[::2]
    padded = np.pad(found, ((9, 9), (0, 0)))
    inputs = np.stack([padded[t : t + 19].ravel() for t in range(len(found))])
    return network((inputs - inputs.mean()) / inputs.std(), graphs.weights())


def test_a_frame_hears_the_published_windows(features: DeepSpeechFeatures) -> None:
    outputs = published(SOUND)
    assert len(outputs) == 70
    found = features.extract(SOUND)
    assert found.shape == (71, 29)
    # Eight zeros at each end, then 16 steps every two: one window a frame of 25 a second.
    padded = np.pad(outputs, ((8, 8), (0, 0)))
    heard = windows(found, (np.arange(30) + 0.5) / 25)
    for frame in (0, 3, 17, 29):
        assert np.allclose(heard[frame], padded[2 * frame : 2 * frame + 16], atol=1e-3)


def test_blocks_give_the_same_as_one_piece(features: DeepSpeechFeatures) -> None:
    whole = features.extract(SOUND)
    parts = features.extract_blocks(lambda: pieces(SOUND, (1, 5000, 321)))
    assert np.array_equal(whole, parts)
    assert features.extract(np.zeros(0, np.float32)).shape == (0, 29)
    assert np.isfinite(features.extract(np.zeros(100, np.float32))).all()


def test_a_long_sound_is_heard_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tensors = graphs.weights()
    for name in (n for n in tensors if n.endswith("cell/bias")):
        tensors[name][2 * graphs.CELLS : 3 * graphs.CELLS] -= 4  # cells that soon forget
    features = DeepSpeechFeatures(graphs.write(tmp_path / "graph.pb", tensors))
    whole = features.extract(SOUND)
    monkeypatch.setattr(deepspeech_features, "PIECE", 30)
    monkeypatch.setattr(deepspeech_features, "AROUND", 25)
    assert np.allclose(features.extract(SOUND), whole, atol=0.01 * whole.std())
    monkeypatch.setattr(deepspeech_features, "AROUND", 0)
    assert not np.allclose(features.extract(SOUND), whole, atol=0.01 * whole.std())


def test_they_are_found_by_name_with_the_weights_of_a_user(graph: Path) -> None:
    found = features_by_name("deepspeech", graph)
    assert (found.name, found.dim) == ("deepspeech", 29)
    assert weights_file("deepspeech", graph) == graph
    assert fingerprint("deepspeech", graph)
    with pytest.raises(
        ExplainedError, match=r"set speech_weights to output_graph\.pb of DeepSpeech"
    ):
        features_by_name("deepspeech")
    with pytest.raises(ExplainedError, match="no frozen TensorFlow graph"):
        features_by_name("deepspeech", Path(__file__))
