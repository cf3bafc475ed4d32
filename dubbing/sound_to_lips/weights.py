"""Files of the lip network's weights: the encoder's and the filter's."""

import json
from pathlib import Path
from typing import Any, TypeVar

from torch import nn

from dubbing.errors import ExplainedError
from dubbing.shipped.weights import load_float, save_half
from dubbing.sound_to_lips.encoder import SpeechEncoder
from dubbing.sound_to_lips.lip_network import LipFilter, LipNetwork
from dubbing.sound_to_lips.paths import ENCODER_WEIGHTS, FILTER_WEIGHTS

ENCODER_FORMAT, FILTER_FORMAT = "dfrf-speech-encoder-1", "dfrf-lips-3"
NetworkT = TypeVar("NetworkT", bound=nn.Module)


def save(network: nn.Module, path: Path, form: str, about: dict[str, Any]) -> None:
    """Write weights in half precision; `about` in the header."""
    save_half(network.state_dict(), path, {"format": form, "about": json.dumps(about)})


def loaded(network: NetworkT, path: Path, form: str, what: str, remedy: str) -> NetworkT:
    """A network with the weights of a file, in evaluation mode.

    Args:
        what: name of the network, for messages.

    Raises:
        ExplainedError: the file is missing, damaged or of another format.
    """
    tensors, _ = load_float(path, form, what, remedy)
    try:
        network.load_state_dict(tensors)
    except RuntimeError as problem:
        raise ExplainedError(
            f"{what} weights do not fit the network", str(path), remedy
        ) from problem
    return network.eval()


def load_encoder() -> SpeechEncoder:
    """The shipped encoder; errors as `loaded`."""
    remedy = "reinstall the package"
    return loaded(SpeechEncoder(), ENCODER_WEIGHTS, ENCODER_FORMAT, "speech encoder", remedy)


def load(path: Path = FILTER_WEIGHTS) -> LipNetwork:
    """The shipped encoder with the filter of a file; errors as `loaded`."""
    training = "python -m dubbing.workshop.training.lips.training"
    remedy = f"make one with '{training}', or reinstall the package"
    network = LipNetwork()
    network.encoder = load_encoder()
    network.filter = loaded(LipFilter(), path, FILTER_FORMAT, "lip", remedy)
    return network.eval()
