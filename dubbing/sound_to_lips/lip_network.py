"""The network that predicts lips from sound, for people it was not trained on.

A frozen speech encoder, and a linear filter over its output: trained on some forty people, a larger
network on top overfitted.

Letters: T steps of 24 ms, C = 288 channels of the encoder, P = 40 outputs.
"""

import json
from pathlib import Path
from typing import Any, TypeVar

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.field.speaker_adaptation import HEARD, PREDICTED
from dubbing.errors import ExplainedError
from dubbing.shipped.weights import load_float, save_half
from dubbing.sound_to_lips.encoder import CHANNELS, SpeechEncoder
from dubbing.sound_to_lips.paths import ENCODER_WEIGHTS, FILTER_WEIGHTS

TAPS, STRIDE = 2, 2  # taps of the filter to each side, and steps between them
ENCODER_FORMAT, FILTER_FORMAT = "dfrf-speech-encoder-1", "dfrf-lips-3"
NetworkT = TypeVar("NetworkT", bound=nn.Module)


class LipFilter(nn.Module):
    """Predicted lips and sound features, the inputs of speaker adaptation.

    Attributes:
        map: a linear filter over time, to lip measures of about mean 0 over speech, and a score of
            touching lips.
        heard: the encoder's first principal components, of mean 0 and variance 1 over speech.
    """

    def __init__(self) -> None:
        super().__init__()
        self.map = nn.Linear(CHANNELS * (2 * TAPS + 1), PREDICTED)
        self.heard = nn.Linear(CHANNELS, HEARD)

    @staticmethod
    def around(x: Float[Tensor, "T C"]) -> Float[Tensor, "T K"]:
        """Each step with its neighbours, K = (2 TAPS + 1) C; the ends are replicated."""
        offsets = torch.arange(-TAPS, TAPS + 1, device=x.device) * STRIDE
        index = torch.arange(len(x), device=x.device)[:, None] + offsets
        return x[index.clamp(0, len(x) - 1)].flatten(1)

    def forward(self, x: Float[Tensor, "T C"]) -> Float[Tensor, "T P"]:
        """Lip measures, a score that rises where lips touch, and sound features."""
        return torch.cat([self.map(self.around(x)), self.heard(x)], 1)


class LipNetwork(nn.Module):
    """The encoder and the filter."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = SpeechEncoder()
        self.filter = LipFilter()


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
