"""File of the acoustic network: its weights, and the map from its outputs to features.

Letters: H = hidden values and S = senones of a step, D feature values.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from dubbing.shipped.weights import load_float, save_half
from dubbing.speech.acoustic_network import AcousticNetwork, AcousticOutput
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS

FORMAT = "dfrf-speech-1"
_PREFIX = "network."


def outputs(output: AcousticOutput) -> Float[Tensor, "B T HS"]:
    """Hidden state and square roots of the senone posteriors, concatenated."""
    return torch.cat([output.hidden, output.senones.softmax(-1).sqrt()], -1)


@dataclass(frozen=True)
class SpeechModel:
    """A network, the linear map (D, H + S) from its `outputs`, and the features (D,) of silence."""

    network: AcousticNetwork
    projection: Tensor
    silence: Tensor

    @property
    def dim(self) -> int:
        return len(self.projection)

    def features(self, output: AcousticOutput) -> Float[Tensor, "B T D"]:
        """Features; 0 in silence."""
        return outputs(output) @ self.projection.T - self.silence


def save_model(model: SpeechModel, path: Path, about: dict[str, Any]) -> None:
    """Write weights in half precision, with `about` in the header."""
    tensors = {_PREFIX + k: v for k, v in model.network.state_dict().items()}
    tensors |= {"projection": model.projection, "silence": model.silence}
    save_half(tensors, path, {"format": FORMAT, "about": json.dumps(about)})


def load_model(path: Path = DEFAULT_WEIGHTS) -> SpeechModel:
    """The model in evaluation mode, float32.

    Raises:
        ExplainedError: the file is missing, damaged or of another format.
    """
    remedy = "make one with 'dfrf train-speech', or reinstall the package"
    tensors, _ = load_float(path, FORMAT, "speech", remedy)
    network = AcousticNetwork()
    network.load_state_dict(
        {k.removeprefix(_PREFIX): v for k, v in tensors.items() if k.startswith(_PREFIX)}
    )
    return SpeechModel(network.eval(), tensors["projection"], tensors["silence"])
