"""Constants of a graph that is written by hand, field by field."""

from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import ExplainedError
from dubbing.speech.deepspeech.graph_constants import constants
from tests.dubbing.speech.deepspeech import graphs


def test_constants_are_read_by_name_in_their_shape(tmp_path: Path) -> None:
    tensors = graphs.weights()
    path = graphs.write(tmp_path / "graph.pb", tensors)
    found = constants(path, set(tensors))
    assert found.keys() == tensors.keys()
    assert all(np.array_equal(found[name], tensors[name]) for name in tensors)
    assert constants(path, {"h1", "h1/read", "input_node", "h4"}).keys() == {"h1"}


def test_one_number_stands_for_all_and_whole_numbers_are_left_out(tmp_path: Path) -> None:
    one = np.full((2, 3), 0.25, np.float32)
    path = tmp_path / "graph.pb"
    shape = graphs.message(2, *(graphs.message(2, graphs.number(1, n)) for n in (2, 3)))
    floats = graphs.message(5, one[0, :1].tobytes())
    tensor = graphs.message(8, graphs.number(1, 1), shape, floats)
    value = graphs.message(5, graphs.message(1, b"value"), graphs.message(2, tensor))
    node = graphs.message(1, graphs.message(1, b"a"), graphs.message(2, b"Const"), value)
    path.write_bytes(node + graphs.constant("whole", one, dtype=3))
    found = constants(path, {"a", "whole"})
    assert found.keys() == {"a"}
    assert np.array_equal(found["a"], one)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "no frozen TensorFlow graph"),
        (b"\x0a\x05ab", "ends in the middle"),
        (b"\xff" * 20, "a number without an end"),
        (b"\x0b", "a field of kind 3"),
        (graphs.constant("h1", np.zeros((2, 2)))[:-3], "ends in the middle"),
    ],
)
def test_another_file_is_refused_in_words(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "other.pb"
    path.write_bytes(content)
    with pytest.raises(ExplainedError, match=rf"{expected}.*\(.*other\.pb\)"):
        constants(path, {"h1"})


def test_a_file_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ExplainedError, match=r"cannot be read.*gone\.pb"):
        constants(tmp_path / "gone.pb", {"h1"})
