"""Runs a network that is stored as a list of steps.

`dubbing/workshop/faces/import_networks.py` writes it; `graph_steps.py` has the steps.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import torch

from dubbing.face.finding.graph_steps import STEPS, VIEWS, Run, Settings
from dubbing.shipped.weights import load_float

FORMAT = "dfrf-graph-1"
REMEDY = "install dfrf again"
REUSED_BYTES = 24 << 20
TOLERANCE = 1e-3


class GraphNetwork:
    """A network of `path`.

    Raises:
        ExplainedError: the file is missing, damaged or of another format.
    """

    def __init__(self, path: Path) -> None:
        weights, header = load_float(path, FORMAT, path.stem.replace("_", " "), REMEDY)
        graph = json.loads(header["graph"])
        self._expected: list[float] = json.loads(header.get("expected", "[]"))
        self._side: int = graph["side"]
        self.graph: list[Settings] = graph["steps"]
        self._input: int = graph["input"]
        self._outputs: list[int] = graph["outputs"]
        self._steps: list[tuple[Run, list[int], int, list[int]]] = []
        needed = set(self._outputs)
        kept = {self._input, *(step["out"] for step in self.graph if step["op"] in VIEWS)}
        for step in reversed(self.graph):
            last = [tensor for tensor in dict.fromkeys(step["in"]) if tensor not in needed]
            needed.update(step["in"])
            constants = [weights[name] for name in step.get("weights", ())]
            # What is not needed afterwards may be overwritten.
            free = step["in"][-1] in last and step["in"][-1] not in kept
            run = STEPS[step["op"]](step | {"in_place": free}, *constants)
            self._steps.append((run, step["in"], step["out"], last))
        self._steps.reverse()

    @torch.inference_mode()
    def __call__(self, images: np.ndarray, low: float = 0.0) -> list[np.ndarray]:
        """The results for images (N, H, W, 3) uint8, whose values become `low` to 1; in float32."""
        with _one_thread(), torch.autocast("cpu", enabled=False):
            pixels = torch.from_numpy(images).permute(0, 3, 1, 2).float()
            values = {self._input: pixels.mul_((1 - low) / 255).add_(low)}
            for run, inputs, output, last in self._steps:
                values[output] = run(*[values[tensor] for tensor in inputs])
                for tensor in last:
                    del values[tensor]
            return [values[tensor].numpy() for tensor in self._outputs]

    def test_results(self) -> list[float]:
        """Means of the results for a drawing of a head on shoulders."""
        image = np.full((self._side, self._side, 3), (90, 110, 130), np.uint8)
        unit = self._side / 16
        for row, radius, colour in ((16, 6, (60, 40, 90)), (7, 4, (210, 160, 130))):
            cv2.circle(image, (self._side // 2, int(row * unit)), int(radius * unit), colour, -1)
        return [float(values.mean(dtype=np.float64)) for values in self(image[None])]

    def works(self) -> bool:
        """Whether it computes here what it computed where it was imported."""
        return bool(np.allclose(self.test_results(), self._expected, TOLERANCE, TOLERANCE))


@lru_cache(maxsize=8)
def network(path: Path) -> GraphNetwork:
    """The network of a file, read once. It keeps nothing of a call, so threads may share it."""
    # glibc takes pieces of memory from the system each time until a larger one was given back.
    # For images that costs as much as the network.
    torch.empty(REUSED_BYTES, dtype=torch.uint8)
    return GraphNetwork(path)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Layers are so small that threads would wait for one another, most of all on busy cores."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
