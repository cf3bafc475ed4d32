"""The lip network on disk."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dubbing.shipped.weights import load_float, save_half
from dubbing.sound_to_lips.network import LipNetwork, Sizes
from dubbing.sound_to_lips.paths import DEFAULT_WEIGHTS

FORMAT = "dfrf-lips-1"


def save(network: LipNetwork, path: Path, about: dict[str, Any]) -> None:
    """Weights in half precision; sizes and `about` in the header."""
    told = {"format": FORMAT, "sizes": json.dumps(network.settings()), "about": json.dumps(about)}
    save_half(network.state_dict(), path, told)


def load(path: Path = DEFAULT_WEIGHTS) -> LipNetwork:
    """The network in evaluation mode.

    Raises:
        DubbingError: the file is missing, damaged or holds something else.
    """
    remedy = "make one with 'python -m dubbing.training.lips.training', or reinstall the package"
    tensors, header = load_float(path, FORMAT, "lip", remedy)
    sizes = json.loads(header["sizes"])
    sizes["dilations"] = tuple(sizes["dilations"])
    network = LipNetwork(tensors["projection"], tensors["silence"], Sizes(**sizes))
    network.load_state_dict(tensors)
    return network.eval()
