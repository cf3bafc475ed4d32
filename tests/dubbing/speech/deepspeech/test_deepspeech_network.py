"""The network beside plain numpy, with random weights of a graph that the test writes."""

from pathlib import Path

import numpy as np
import pytest
import torch

from dubbing.errors import ExplainedError
from dubbing.speech.deepspeech.deepspeech_network import load
from tests.dubbing.speech.deepspeech import graphs


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))


def recurrent(x: np.ndarray, kernel: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """An LSTM with gates input, cell, forget (and 1), output over steps (T, C)."""
    hidden = cell = np.zeros(len(bias) // 4)
    out = []
    for row in x:
        i, j, f, o = np.split(np.concatenate([row, hidden]) @ kernel + bias, 4)
        cell = cell * sigmoid(f + 1) + sigmoid(i) * np.tanh(j)
        hidden = np.tanh(cell) * sigmoid(o)
        out.append(hidden)
    return np.stack(out)


def literal(x: np.ndarray, tensors: dict[str, np.ndarray]) -> np.ndarray:
    w = {name: array.astype(np.float64) for name, array in tensors.items()}

    def dense(x: np.ndarray, layer: int) -> np.ndarray:
        return np.clip(x @ w[f"h{layer}"] + w[f"b{layer}"], 0, 20)

    for layer in (1, 2, 3):
        x = dense(x, layer)
    cells = "bidirectional_rnn/{}/basic_lstm_cell/"
    there, back = ([w[cells.format(d) + k] for k in ("kernel", "bias")] for d in ("fw", "bw"))
    both = np.concatenate([recurrent(x, *there), recurrent(x[::-1], *back)[::-1]], axis=1)
    return dense(both, 5) @ w["h6"] + w["b6"]


@pytest.mark.parametrize("scale", [1.0, 30.0], ids=["", "clipped at 20"])
def test_the_network_computes_what_numpy_computes(tmp_path: Path, scale: float) -> None:
    tensors = graphs.weights()
    network = load(graphs.write(tmp_path / "output_graph.pb", tensors))
    x = np.random.default_rng(1).normal(size=(40, 494)) * scale
    with torch.no_grad():
        found = network(torch.from_numpy(x.astype(np.float32))).numpy()
    expected = literal(x, tensors)
    assert expected.std() > 0.1
    assert np.allclose(found, expected, atol=1e-4)


def test_another_graph_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "graph.pb"
    tensors = graphs.weights()

    def refused(message: str, **other: np.ndarray | None) -> None:
        kept = {name: array for name, array in {**tensors, **other}.items() if array is not None}
        with pytest.raises(
            ExplainedError, match=rf"{message}.*name output_graph\.pb of DeepSpeech"
        ):
            load(graphs.write(path, kept))

    refused("holds no 'h3'", h3=None)
    refused("holds no 'b5'", b5=None)
    refused("first.weight does not fit", h1=np.zeros((26, 7)))
    refused("sixth.weight does not fit", h6=np.zeros((8, 33)), b6=np.zeros(33))
    refused("third.bias does not fit", b3=np.zeros((10, 1)))
