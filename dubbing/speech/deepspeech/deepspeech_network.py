"""DeepSpeech 0.1.0: five dense layers and a bidirectional LSTM, with weights of the user's own.

Hannun et al., *Deep Speech: Scaling up end-to-end speech recognition* (2014), as Mozilla trained
it: rectified layers clipped at 20, an LSTM instead of a plain recurrence, 29 outputs for 26
letters, space, apostrophe and blank.

Letters: T steps of 20 ms, I = 494 inputs, O = 29 outputs, H cells a direction.
"""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from dubbing.errors import ExplainedError
from dubbing.speech.deepspeech.cepstra import INPUTS
from dubbing.speech.deepspeech.graph_constants import constants

OUTPUTS = 29
CLIP = 20.0
WANTED = "name output_graph.pb of DeepSpeech 0.1.0"
# Ours -> weights and biases of the graph. There is no fourth: that is the LSTM.
DENSE = {"first": 1, "second": 2, "third": 3, "fifth": 5, "sixth": 6}
DIRECTIONS = {
    "": "bidirectional_rnn/fw/basic_lstm_cell",
    "_reverse": "bidirectional_rnn/bw/basic_lstm_cell",
}
NAMES = {f"{kind}{number}" for number in DENSE.values() for kind in "hb"} | {
    f"{cell}/{kind}" for cell in DIRECTIONS.values() for kind in ("kernel", "bias")
}


class DeepSpeech(nn.Module):
    """The network.

    Args:
        widths: of the first three layers and of the fifth.
        cells: H.
    """

    def __init__(self, widths: tuple[int, int, int, int], cells: int) -> None:
        super().__init__()
        first, second, third, fifth = widths
        self.first = nn.Linear(INPUTS, first)
        self.second = nn.Linear(first, second)
        self.third = nn.Linear(second, third)
        self.lstm = nn.LSTM(third, cells, bidirectional=True)
        self.fifth = nn.Linear(2 * cells, fifth)
        self.sixth = nn.Linear(fifth, OUTPUTS)

    def forward(self, inputs: Float[Tensor, "T I"]) -> Float[Tensor, "T O"]:
        """Outputs before the softmax."""
        x = inputs
        for layer in (self.first, self.second, self.third):
            x = layer(x).clamp(0, CLIP)
        x, _ = self.lstm(x)
        return self.sixth(self.fifth(x).clamp(0, CLIP))


def load(path: Path) -> DeepSpeech:
    """The network with the weights of a frozen graph, for use.

    Raises:
        ExplainedError: the file cannot be read, or is no such graph.
    """
    weights = constants(path, NAMES)
    try:
        first, second, third, fifth = (len(weights[f"b{number}"]) for number in (1, 2, 3, 5))
        cells = len(weights[f"{DIRECTIONS['']}/bias"]) // 4
        state = _state(weights, cells)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        missing = f"no {error}" if isinstance(error, KeyError) else "tensors of other shapes"
        raise ExplainedError(f"holds {missing}", str(path), WANTED) from error
    with torch.device("meta"):
        network = DeepSpeech((first, second, third, fifth), cells)
    shapes = {name: tuple(p.shape) for name, p in network.named_parameters()}
    if other := [name for name, array in state.items() if array.shape != shapes[name]]:
        raise ExplainedError(f"is another network: {other[0]} does not fit", str(path), WANTED)
    network.to_empty(device="cpu")
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            parameter.copy_(torch.from_numpy(np.array(state[name], np.float32)))
    return network.eval()


def _state(weights: dict[str, np.ndarray], cells: int) -> dict[str, np.ndarray]:
    """Our names -> the weights of the graph, which are transposed there.

    It has the gates of the LSTM in another order (input, cell, forget, output; ours input, forget,
    cell, output), adds 1 to the forget gate, and has one bias where ours has two.
    """
    state = {}
    for name, number in DENSE.items():
        state[f"{name}.weight"] = weights[f"h{number}"].T
        state[f"{name}.bias"] = weights[f"b{number}"]
    for direction, cell in DIRECTIONS.items():
        kernel, bias = weights[f"{cell}/kernel"], weights[f"{cell}/bias"]
        gates = np.concatenate([np.arange(cells) + k * cells for k in (0, 2, 1, 3)])
        forget = np.repeat([0, 1, 0, 0], cells)
        state[f"lstm.weight_ih_l0{direction}"] = kernel[:-cells, gates].T
        state[f"lstm.weight_hh_l0{direction}"] = kernel[-cells:, gates].T
        state[f"lstm.bias_ih_l0{direction}"] = bias[gates] + forget
        state[f"lstm.bias_hh_l0{direction}"] = np.zeros(4 * cells)
    return state
