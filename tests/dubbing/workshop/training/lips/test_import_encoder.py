"""The encoder is read out of a graph in onnxruntime's format: names, bytes with a scale, layers."""
# ruff: noqa: N802 (the methods of the format's reader)

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import torch

from dubbing.sound_to_lips.encoder import AFTER, BEFORE, LAYERS, STEP, SpeechEncoder
from dubbing.workshop.training.lips.import_encoder import NAMES, PARTS, TYPES, state_of

pytestmark = pytest.mark.medium


NUMBERS = {np.dtype(kind): number for number, kind in TYPES.items()}


@dataclass(frozen=True)
class Constant:
    """A constant of a graph, with the methods of the format's reader."""

    name: str
    values: np.ndarray

    def Name(self) -> bytes:
        return self.name.encode()

    def DataType(self) -> int:
        return NUMBERS[self.values.dtype]

    def DimsLength(self) -> int:
        return self.values.ndim

    def Dims(self, k: int) -> int:
        return self.values.shape[k]

    def RawDataAsNumpy(self) -> np.ndarray:
        return np.frombuffer(self.values.tobytes(), np.uint8)


@dataclass(frozen=True)
class Step:
    """An operation: the names of what it reads, and of what it makes."""

    reads: tuple[str, ...]
    made: str

    def InputsLength(self) -> int:
        return len(self.reads)

    def Inputs(self, k: int) -> bytes:
        return self.reads[k].encode()

    def Outputs(self, _k: int) -> bytes:
        return self.made.encode()


class Graph:
    """A graph that holds an encoder as the published file does, with two layers more."""

    def __init__(self, encoder: SpeechEncoder) -> None:
        state = {name: value.detach().numpy() for name, value in encoder.state_dict().items()}
        self.constants = [Constant(theirs, state[ours]) for ours, theirs in NAMES.items()]
        self.nodes = []
        for part, made in (("weight", "Mul"), ("bias", "Add")):
            self.constants.append(Constant(f"norm {part}", state[f"norm.{part}"][:, None]))
            self.nodes.append(Step(("x", f"norm {part}"), f"/groupnorm/{made}_output_0"))
        for k in range(LAYERS + 2):
            self.add_layer(k, {n: state[f"layers.{k % LAYERS}.{n}"] for n in LAYER})

    def add_layer(self, k: int, layer: dict[str, np.ndarray]) -> None:
        plain = {
            "input_layernorm.weight": "before_attention.weight",
            "post_attention_layernorm.weight": "before_perceptron.weight",
            "mlp.fc1.bias": "wide.bias",
            "mlp.fc2.bias": "narrow.bias",
        }
        self.constants += [Constant(f"layers.{k}.{t}", layer[ours]) for t, ours in plain.items()]
        for theirs, ours in PARTS.items():
            matrix, name = layer[f"{ours}.weight"].T, f"onnx::MatMul_{k}_{ours}"
            scale = np.float32((matrix.max() - matrix.min()) / 255)
            zero = np.uint8(np.clip(np.round(-matrix.min() / scale), 0, 255))
            held = np.clip(np.round(matrix / scale) + zero, 0, 255).astype(np.uint8)
            values: dict[str, np.ndarray] = {
                "quantized": held,
                "scale": np.array(scale),
                "zero_point": np.array(zero),
            }
            self.constants += [Constant(f"{name}_{n}", value) for n, value in values.items()]
            self.nodes.append(Step(("x", f"{name}_quantized"), f"/layers.{k}/{theirs}/MatMul"))

    def InitializersLength(self) -> int:
        return len(self.constants)

    def Initializers(self, k: int) -> Constant:
        return self.constants[k]

    def NodesLength(self) -> int:
        return len(self.nodes)

    def Nodes(self, k: int) -> Step:
        return self.nodes[k]


LAYER = [f"{part}.weight" for part in PARTS.values()] + [
    *("before_attention.weight", "before_perceptron.weight", "wide.bias", "narrow.bias")
]


def test_an_encoder_comes_out_as_it_went_in() -> None:
    torch.manual_seed(0)
    encoder, again = SpeechEncoder(), SpeechEncoder()
    sound = torch.randn(20 * STEP + BEFORE + AFTER)
    with torch.no_grad():
        before = again(sound)
        again.load_state_dict(state_of(Graph(encoder)))
        wanted, found = encoder(sound), again(sound)
    error = (found - wanted).square().mean() / wanted.square().mean()
    assert error < 1e-3  # matrices are held in bytes
    assert (before - wanted).square().mean() / wanted.square().mean() > 0.1
