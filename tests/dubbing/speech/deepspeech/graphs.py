"""A frozen graph of random weights, written as TensorFlow writes one: nodes of constants."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

CELLS = 5
WIDTHS = {1: 7, 2: 6, 3: 10, 5: 8, 6: 29}  # outputs of the dense layers


def varint(value: int) -> bytes:
    low, rest = value & 127, value >> 7
    return bytes([low | 128]) + varint(rest) if rest else bytes([low])


def message(field: int, *parts: bytes) -> bytes:
    """A field of bytes: key (number, kind 2), length, bytes."""
    whole = b"".join(parts)
    return varint(field << 3 | 2) + varint(len(whole)) + whole


def number(field: int, value: int) -> bytes:
    return varint(field << 3) + varint(value)


def constant(name: str, array: np.ndarray, *, as_floats: bool = False, dtype: int = 1) -> bytes:
    """A node: name, operation, device, attributes dtype and value."""
    shape = message(2, *(message(2, number(1, size)) for size in array.shape))
    numbers = array.astype("<f4").tobytes()
    tensor = message(8, number(1, dtype), shape, message(5 if as_floats else 4, numbers))
    kind = message(5, message(1, b"dtype"), message(2, number(6, dtype)))
    value = message(5, message(1, b"value"), message(2, tensor))
    return message(1, message(1, name.encode()), message(2, b"Const"), kind, value)


def identity(name: str, of: str) -> bytes:
    """What reads a constant in a frozen graph."""
    return message(1, message(1, name.encode()), message(2, b"Identity"), message(3, of.encode()))


def weights(seed: int = 0) -> dict[str, np.ndarray]:
    """Tensors of a small DeepSpeech, by their names in the graph."""
    random = np.random.default_rng(seed)

    def matrix(inputs: int, outputs: int, gain: float = 2) -> np.ndarray:
        return random.normal(size=(inputs, outputs)).astype(np.float32) * math.sqrt(gain / inputs)

    found = {}
    inputs = 494
    for layer, width in WIDTHS.items():
        if layer == 5:
            inputs = 2 * CELLS
        found[f"h{layer}"] = matrix(inputs, width)
        found[f"b{layer}"] = random.normal(size=width).astype(np.float32) * 0.3
        inputs = width
    for way in ("fw", "bw"):
        cell = f"bidirectional_rnn/{way}/basic_lstm_cell"
        found[f"{cell}/kernel"] = matrix(WIDTHS[3] + CELLS, 4 * CELLS)
        found[f"{cell}/bias"] = random.normal(size=4 * CELLS).astype(np.float32) * 0.3
    return found


def write(path: Path, tensors: Mapping[str, np.ndarray]) -> Path:
    nodes = [message(1, message(1, b"input_node"), message(2, b"Placeholder"))]
    for k, (name, array) in enumerate(tensors.items()):
        nodes += [constant(name, array, as_floats=k % 2 == 1), identity(f"{name}/read", name)]
    path.write_bytes(b"".join(nodes) + message(4, number(1, 24)))  # the version of the graph
    return path
