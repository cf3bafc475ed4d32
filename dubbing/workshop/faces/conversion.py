"""From a TFLite graph to the steps that `dubbing/face/finding/graph_steps.py` runs.

Images become (N, C, H, W). A step is a dictionary: `op`, `in` and `out` (numbers of tensors),
`weights` (names of constants), and settings.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from dubbing.workshop.faces.flatbuffer import Graph, Operator

Step = dict[str, Any]
SAME = 0
ACTIVATIONS = {0: "", 3: "relu6"}
# Rows and columns of a 4 x 4 matrix that move points of a plane.
PLANE = np.ix_((0, 1), (0, 1, 3))


def convert(graph: Graph) -> tuple[list[Step], list[int], dict[str, np.ndarray]]:
    """Steps, numbers of the results, and constants of a graph.

    Raises:
        ValueError: an operator is used in a way that no step has.
    """
    return _Conversion(graph).result()


class _Conversion:
    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._constants = dict(graph.constants)
        self._same: dict[int, int] = {}  # tensors that are another one unchanged
        self._padded: dict[int, int] = {}  # tensors with channels of zeros added, and the tensor
        self._weights: dict[str, np.ndarray] = {}
        self._steps: list[Step] = []

    def result(self) -> tuple[list[Step], list[int], dict[str, np.ndarray]]:
        for operator in self._graph.operators:
            getattr(self, f"_{operator.name}", self._plain)(operator)
        outputs = [self._same.get(tensor, tensor) for tensor in self._graph.outputs]
        return self._steps, outputs, self._weights

    def _shape(self, tensor: int) -> list[int]:
        return self._graph.shapes[tensor]

    def _add_step(self, op: str, operator: Operator, count: int, **settings: Any) -> None:
        """A step whose inputs are the first `count` tensors of an operator."""
        inputs = [self._same.get(tensor, tensor) for tensor in operator.inputs[:count]]
        self._steps.append({"op": op, "in": inputs, "out": operator.outputs[0], **settings})

    def _keep(self, operator: Operator, *values: np.ndarray) -> list[str]:
        names = [f"{operator.outputs[0]}.{k}" for k in range(len(values))]
        self._weights.update(zip(names, values, strict=True))
        return names

    def _plain(self, operator: Operator) -> None:
        if operator.name not in ("sigmoid", "relu", "hardswish"):
            raise ValueError(f"unknown operator {operator.name}")
        self._add_step(operator.name, operator, 1)

    def _dequantize(self, operator: Operator) -> None:
        self._constants[operator.outputs[0]] = self._constants[operator.inputs[0]]

    def _slice(self, operator: Operator) -> None:
        if self._shape(operator.inputs[0]) != self._shape(operator.outputs[0]):
            raise ValueError("a slice that is not the whole")
        self._same[operator.outputs[0]] = operator.inputs[0]

    def _convolve(self, operator: Operator) -> None:
        weight, bias = (self._constants[k] for k in operator.inputs[1:3])
        self._convolution(operator, weight.transpose(0, 3, 1, 2), bias, 1, operator.option(3, "b"))

    def _convolve_depthwise(self, operator: Operator) -> None:
        weight, bias = (self._constants[k] for k in operator.inputs[1:3])
        groups = weight.shape[3]
        activation = operator.option(4, "b")
        self._convolution(operator, weight.transpose(3, 0, 1, 2), bias, groups, activation)

    def _convolution(
        self, operator: Operator, weight: np.ndarray, bias: np.ndarray, groups: int, activation: int
    ) -> None:
        stride, kernel = operator.option(1), weight.shape[2]
        height, width = self._shape(operator.inputs[0])[1:3]
        if kernel != weight.shape[3] or operator.option(2) != stride or height != width:
            raise ValueError("a convolution that is not square")
        if activation not in ACTIVATIONS:
            raise ValueError("a convolution with another activation")
        whole = max((-(-height // stride) - 1) * stride + kernel - height, 0)
        padding = whole if operator.option(0, "b") == SAME else 0
        self._add_step(
            "convolve",
            operator,
            1,
            weights=self._keep(operator, weight, bias),
            stride=stride,
            groups=groups,
            padding=[padding // 2, padding - padding // 2],
            **({"then": ACTIVATIONS[activation]} if activation else {}),
        )

    def _Convolution2DTransposeBias(self, operator: Operator) -> None:  # noqa: N802
        weight, bias = (self._constants[k] for k in operator.inputs[1:])
        _, *stride = struct.unpack("<3i", operator.custom)
        if stride != list(weight.shape[1:3]):
            raise ValueError("a transposed convolution that overlaps")
        weights = self._keep(operator, weight.transpose(3, 0, 1, 2), bias)
        self._add_step("convolve_transposed", operator, 1, weights=weights, stride=stride[0])

    def _prelu(self, operator: Operator) -> None:
        slope = self._constants[operator.inputs[1]].reshape(-1)
        self._add_step("prelu", operator, 1, weights=self._keep(operator, slope))

    def _pad(self, operator: Operator) -> None:
        amounts = self._constants[operator.inputs[1]]
        if amounts[:3].any() or amounts[3, 0]:
            raise ValueError("padding of anything but channels")
        self._padded[operator.outputs[0]] = operator.inputs[0]

    def _add(self, operator: Operator) -> None:
        """A first summand with fewer channels is added to the first ones of the second."""
        first, second = operator.inputs
        op = "add_narrow" if first in self._padded else "add"
        first = self._padded.get(first, first)
        changed = Operator("add", [first, second], operator.outputs, operator.options, b"")
        self._add_step(op, changed, 2)

    def _multiply(self, operator: Operator) -> None:
        factor = self._constants.get(operator.inputs[1])
        if factor is None:
            self._add_step("multiply", operator, 2)
            return
        if factor.shape == (1, 4, 4):
            factor = factor[0][PLANE][None]
        self._add_step("scale", operator, 1, weights=self._keep(operator, factor))

    def _max_pool(self, operator: Operator) -> None:
        stride, size = operator.option(1), operator.option(3)
        if stride != size or operator.option(2) != stride or operator.option(4) != size:
            raise ValueError("pooling that is not square")
        if self._shape(operator.inputs[0])[1] % size:
            raise ValueError("pooling beyond the edge")
        self._add_step(operator.name, operator, 1, size=size)

    _average_pool = _max_pool

    def _mean(self, operator: Operator) -> None:
        """Of all pixels. The result stays an image, of one pixel."""
        height, width = self._shape(operator.inputs[0])[1:3]
        if self._constants[operator.inputs[1]].tolist() != [1, 2] or height != width:
            raise ValueError("a mean of anything but the pixels of a square")
        self._add_step("average_pool", operator, 1, size=height)

    def _fully_connected(self, operator: Operator) -> None:
        """Of an image of one pixel."""
        weight, bias = (self._constants[k] for k in operator.inputs[1:3])
        if operator.option(0, "b"):
            raise ValueError("a full connection with an activation")
        kept = self._keep(operator, weight[:, :, None, None], bias)
        self._add_step("convolve", operator, 1, weights=kept, stride=1, groups=1, padding=[0, 0])

    def _resize(self, operator: Operator) -> None:
        if operator.option(2, "b") or not operator.option(3, "b"):
            raise ValueError("resizing from corner to corner")
        self._add_step("resize", operator, 1, size=self._shape(operator.outputs[0])[1:3])

    def _reshape(self, operator: Operator) -> None:
        self._add_step("reshape", operator, 1, shape=self._shape(operator.outputs[0])[1:])

    def _concatenate(self, operator: Operator) -> None:
        if operator.option(0) != 1:
            raise ValueError("concatenation along another axis")
        self._add_step("concatenate", operator, len(operator.inputs))

    def _Landmarks2TransformMatrix(self, operator: Operator) -> None:  # noqa: N802
        options = _flexible(operator.custom)
        size, scale = options["output_width"], options["scale_x"]
        if size != options["output_height"] or scale != options["scale_y"]:
            raise ValueError("a crop that is not square")
        if options["target_rotation_radians"]:
            raise ValueError("a crop with a rotation of its own")
        ends = [options["left_rotation_idx"], options["right_rotation_idx"]]
        subsets = [options["subset_idxs"]]
        self._add_step("box", operator, 1, size=size, scale=scale, ends=[ends], points=subsets)

    def _TransformTensorBilinear(self, operator: Operator) -> None:  # noqa: N802
        size = _flexible(operator.custom)["output_width"]
        self._add_step("crop", operator, 2, size=size)

    def _TransformLandmarks(self, operator: Operator) -> None:  # noqa: N802
        self._add_step("transform", operator, 2)


def _flexible(data: bytes) -> dict[str, Any]:
    """Options of a custom operator."""
    from flatbuffers import flexbuffers

    options = flexbuffers.Loads(data)
    assert isinstance(options, dict)
    return options
