"""Reads the parts of a TFLite file that the importer needs.

Format: https://flatbuffers.dev/internals; field numbers: tensorflow/lite/schema/schema.fbs.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

TYPES = {0: np.float32, 1: np.float16, 2: np.int32}
OPERATORS = {
    0: "add",
    1: "average_pool",
    2: "concatenate",
    3: "convolve",
    4: "convolve_depthwise",
    6: "dequantize",
    9: "fully_connected",
    14: "sigmoid",
    17: "max_pool",
    18: "multiply",
    19: "relu",
    22: "reshape",
    23: "resize",
    34: "pad",
    40: "mean",
    45: "slice",
    54: "prelu",
    117: "hardswish",
}


@dataclass(frozen=True)
class Table:
    """A table of a flatbuffer: bytes, and the place where it begins."""

    data: bytes
    start: int

    @classmethod
    def root(cls, data: bytes) -> Table:
        return cls(data, _number(data, "I", 0))

    def _place(self, field: int) -> int:
        """Place of a field, 0 where it has its default."""
        layout = self.start - _number(self.data, "i", self.start)
        entry = 4 + 2 * field
        if entry >= _number(self.data, "H", layout):
            return 0
        offset = _number(self.data, "H", layout + entry)
        return self.start + offset if offset else 0

    def number(self, field: int, form: str = "i") -> int:
        place = self._place(field)
        return int(_number(self.data, form, place)) if place else 0

    def table(self, field: int) -> Table | None:
        place = self._place(field)
        return Table(self.data, place + _number(self.data, "I", place)) if place else None

    def numbers(self, field: int, form: str = "i") -> list[int]:
        place = self._place(field)
        if not place:
            return []
        place += _number(self.data, "I", place)
        count = _number(self.data, "I", place)
        return list(struct.unpack_from(f"<{count}{form}", self.data, place + 4))

    def text(self, field: int) -> str:
        return bytes(self.numbers(field, "B")).decode()

    def tables(self, field: int) -> list[Table]:
        place = self._place(field)
        if not place:
            return []
        place += _number(self.data, "I", place)
        places = range(place + 4, place + 4 + 4 * _number(self.data, "I", place), 4)
        return [Table(self.data, p + _number(self.data, "I", p)) for p in places]


def _number(data: bytes, form: str, place: int) -> Any:
    return struct.unpack_from(f"<{form}", data, place)[0]


@dataclass(frozen=True)
class Operator:
    """One operator of a graph: name, tensors by number, table of options, custom options."""

    name: str
    inputs: list[int]
    outputs: list[int]
    options: Table | None
    custom: bytes

    def option(self, field: int, form: str = "i") -> int:
        return self.options.number(field, form) if self.options else 0


@dataclass(frozen=True)
class Graph:
    """The first graph of a file: operators in their order, shapes and constants by tensor."""

    operators: list[Operator]
    inputs: list[int]
    outputs: list[int]
    shapes: list[list[int]]
    constants: dict[int, np.ndarray]


def read_graph(data: bytes) -> Graph:
    """The graph of a TFLite file.

    Raises:
        KeyError: an operator or a number format that is not known here.
    """
    model = Table.root(data)
    codes = [
        code.text(1) or OPERATORS[code.number(3) or code.number(0, "b")] for code in model.tables(1)
    ]
    buffers = [bytes(buffer.numbers(0, "B")) for buffer in model.tables(4)]
    (graph,) = model.tables(2)
    shapes, constants = [], {}
    for index, tensor in enumerate(graph.tables(0)):
        shapes.append(tensor.numbers(0))
        if raw := buffers[tensor.number(2, "I")]:
            kind = TYPES[tensor.number(1, "b")]
            constants[index] = np.frombuffer(raw, kind).reshape(shapes[-1])
    operators = [
        Operator(
            codes[entry.number(0, "I")],
            entry.numbers(1),
            entry.numbers(2),
            entry.table(4),
            bytes(entry.numbers(5, "B")),
        )
        for entry in graph.tables(3)
    ]
    return Graph(operators, graph.numbers(1), graph.numbers(2), shapes, constants)
