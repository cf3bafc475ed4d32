"""Reads the weights of a frozen TensorFlow graph without TensorFlow: its constants by name.

The file is a protocol buffer, `GraphDef`. Of its fields only these are read: a graph's nodes, a
node's name, operation and attribute `value`, and the type, shape and numbers of that tensor.
"""

import math
import mmap
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from dubbing.errors import ExplainedError

# Numbers of the fields in TensorFlow's graph.proto, node_def.proto, attr_value.proto, tensor.proto.
NODE = 1
NAME, OPERATION, ATTRIBUTE = 1, 2, 5
KEY, VALUE = 1, 2
TENSOR = 8
DTYPE, SHAPE, CONTENT, FLOATS = 1, 2, 4, 5
DIMENSION, SIZE = 2, 1
FLOAT32 = 1
VARINT, LENGTH, FIXED = 0, 2, {1: 8, 5: 4}  # kinds of fields; bytes of those of one length
LONGEST_VARINT = 10  # bytes


def constants(path: Path, wanted: Collection[str]) -> dict[str, np.ndarray]:
    """The wanted float32 constants that a graph has, by name; views of the file, read-only.

    Raises:
        ExplainedError: the file cannot be read, or is no graph.
    """
    try:
        with open(path, "rb") as file:
            data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        named = [(bytes(_last(node, NAME)).decode(), node) for node in _messages(data, NODE)]
        arrays = [(name, _constant(node)) for name, node in named if name in wanted]
    except OSError as error:
        raise ExplainedError(f"cannot be read: {error.strerror}", str(path)) from error
    except ValueError as error:
        raise ExplainedError(f"is no frozen TensorFlow graph: {error}", str(path)) from error
    return {name: numbers for name, numbers in arrays if numbers is not None}


def _constant(node: memoryview) -> np.ndarray | None:
    """The numbers of a node; None where it is no float32 constant."""
    if _last(node, OPERATION) == b"Const":
        for attribute in _messages(node, ATTRIBUTE):
            if _last(attribute, KEY) == b"value":
                return _numbers(_last(_last(attribute, VALUE), TENSOR))
    return None


def _numbers(tensor: memoryview) -> np.ndarray | None:
    """The numbers of a tensor in their shape; None where they are not float32."""
    if _count(tensor, DTYPE) != FLOAT32:
        return None
    shape = [_count(size, SIZE) for size in _messages(_last(tensor, SHAPE), DIMENSION)]
    numbers = np.frombuffer(bytes(_last(tensor, FLOATS)) or _last(tensor, CONTENT), "<f4")
    if len(numbers) == 1:  # one number stands for all
        numbers = np.broadcast_to(numbers, math.prod(shape))
    return numbers.reshape(shape)


def _messages(data: memoryview, wanted: int) -> Iterator[memoryview]:
    """All values of a field that are bytes: messages, texts, packed numbers."""
    for field, value in _fields(data):
        if field == wanted and isinstance(value, memoryview):
            yield value


def _last(data: memoryview, wanted: int) -> memoryview:
    """The value of a field that stands once; empty where there is none."""
    return next(reversed(list(_messages(data, wanted))), memoryview(b""))


def _count(data: memoryview, wanted: int) -> int:
    """The whole number of a field; 0, which is not written, where there is none."""
    return max(
        (v for field, v in _fields(data) if field == wanted and isinstance(v, int)), default=0
    )


def _fields(data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Number and value of each field of a message."""
    place = 0
    while place < len(data):
        key, place = _varint(data, place)
        kind = key & 7
        if kind == VARINT:
            value, place = _varint(data, place)
            yield key >> 3, value
            continue
        if kind == LENGTH:
            size, place = _varint(data, place)
        elif kind in FIXED:
            size = FIXED[kind]
        else:
            raise ValueError(f"a field of kind {kind}")
        if place + size > len(data):
            raise ValueError("it ends in the middle of a field")
        yield key >> 3, data[place : place + size]
        place += size


def _varint(data: memoryview, place: int) -> tuple[int, int]:
    """A whole number, seven bits a byte, and the place after it."""
    value = 0
    for k, byte in enumerate(data[place : place + LONGEST_VARINT]):
        value |= (byte & 127) << 7 * k
        if byte < 128:
            return value, place + k + 1
    raise ValueError("a number without an end")
