"""What native code writes to standard error is dropped for a moment, and only then."""

import os
from collections import namedtuple
from typing import Any

import numpy as np
import pytest

from dubbing.face.mediapipe_graph import Solution, without_native_messages
from dubbing.preparation.matting.person_masks import PersonMasks


def test_only_what_is_written_inside_is_dropped(capfd: pytest.CaptureFixture[str]) -> None:
    os.write(2, b"before ")
    with without_native_messages():
        os.write(2, b"inside ")
    os.write(2, b"after")
    assert capfd.readouterr().err == "before after"


def test_errors_pass_and_messages_are_back(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="no face"), without_native_messages():
        raise ValueError("no face")
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"


Found = namedtuple("Found", ["faces"])


class Talkative:
    """Reports its start, every frame, and what it finds from the fourth frame on."""

    def __init__(self) -> None:
        os.write(2, b"start ")
        self.frames = 0

    def process(self, image: np.ndarray) -> Any:
        os.write(2, b"frame ")
        self.frames += 1
        return Found(["face"] if self.frames > 3 else None)


def test_a_solution_is_silent_until_it_has_found_something(
    capfd: pytest.CaptureFixture[str],
) -> None:
    solution, image = Solution(Talkative), np.zeros((2, 2, 3), np.uint8)
    assert [solution.process(image).faces for _ in range(3)] == [None, None, ["face"]]
    assert capfd.readouterr().err == ""
    solution.process(image)
    assert capfd.readouterr().err == "frame "


def test_mediapipe_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    with PersonMasks() as person_masks:
        person_masks.mask(np.zeros((64, 64, 3), np.uint8))
    assert capfd.readouterr().err == ""
