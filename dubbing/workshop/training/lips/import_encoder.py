"""Import of the shipped speech encoder.

    python -m dubbing.workshop.training.lips.import_encoder FILE --out FILE

FILE is `assets/tiny-en/encoder_model.ort` of the package moonshine-voice 0.0.62 (MIT licence), a
model in the format of onnxruntime, which must be installed. Its matrices are bytes with a scale.
"""

import re
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import typer
from torch import Tensor

from dubbing.sound_to_lips.encoder import LAYERS, SpeechEncoder
from dubbing.sound_to_lips.lip_network import ENCODER_FORMAT, save

TYPES = {1: np.float32, 2: np.uint8, 7: np.int64}  # numbers of the format
PARTS = {
    "self_attn/q_proj": "query",
    "self_attn/k_proj": "key",
    "self_attn/v_proj": "value",
    "self_attn/o_proj": "out",
    "mlp/fc1": "wide",
    "mlp/fc2": "narrow",
}
NAMES = {
    "first.weight": "conv1.weight_add_tensor",
    "second.weight": "conv2.weight_add_tensor",
    "second.bias": "conv2.bias",
    "third.weight": "conv3.weight_add_tensor",
    "third.bias": "conv3.bias",
}


def tensors_of(graph: Any) -> dict[str, np.ndarray]:
    """The constants of a graph by name."""
    constants = {}
    for k in range(graph.InitializersLength()):
        one = graph.Initializers(k)
        if one.DataType() in TYPES:
            shape = [one.Dims(n) for n in range(one.DimsLength())]
            raw = one.RawDataAsNumpy().tobytes()
            values = np.frombuffer(raw, TYPES[one.DataType()]).reshape(shape)
            constants[one.Name().decode()] = values
    return constants


def state_of(graph: Any) -> dict[str, Tensor]:
    """The weights of a `SpeechEncoder`."""
    constants = tensors_of(graph)
    state = {ours: constants[theirs] for ours, theirs in NAMES.items()}
    for k in range(graph.NodesLength()):
        node = graph.Nodes(k)
        output = node.Outputs(0).decode()
        reads = [node.Inputs(n).decode() for n in range(node.InputsLength())]
        matrix = next(
            (name for name in reads if name.endswith("_quantized") and name.startswith("onnx::")),
            None,
        )
        place = re.match(r"/layers\.(\d)/(\w+/\w+)/", output)
        if matrix and place and int(place[1]) < LAYERS:
            of = matrix.removesuffix("_quantized")
            zero, scale = float(constants[of + "_zero_point"]), float(constants[of + "_scale"])
            name = f"layers.{place[1]}.{PARTS[place[2]]}.weight"
            state[name] = (constants[matrix].astype(np.float32) - zero).T * scale
        if output == "/groupnorm/Mul_output_0":
            state["norm.weight"] = constants[reads[1]][:, 0]
        if output == "/groupnorm/Add_output_0":
            state["norm.bias"] = constants[reads[1]][:, 0]
    for k in range(LAYERS):
        theirs, ours = f"layers.{k}", f"layers.{k}"
        state[f"{ours}.before_attention.weight"] = constants[f"{theirs}.input_layernorm.weight"]
        state[f"{ours}.before_perceptron.weight"] = constants[
            f"{theirs}.post_attention_layernorm.weight"
        ]
        state[f"{ours}.wide.bias"] = constants[f"{theirs}.mlp.fc1.bias"]
        state[f"{ours}.narrow.bias"] = constants[f"{theirs}.mlp.fc2.bias"]
    return {name: torch.from_numpy(values.copy()) for name, values in state.items()}


def main(
    model: Annotated[Path, typer.Argument(exists=True, dir_okay=False)],
    out: Annotated[Path, typer.Option("--out", help="The weights to write.")],
) -> None:
    """Take the first layers of Moonshine tiny's encoder out of onnxruntime's format."""
    from onnxruntime.tools.ort_format_model.ort_flatbuffers_py.fbs.InferenceSession import (
        InferenceSession,
    )

    session = InferenceSession.GetRootAsInferenceSession(bytearray(model.read_bytes()), 0)
    encoder = SpeechEncoder()
    encoder.load_state_dict(state_of(session.Model().Graph()))
    about = {"from": "Moonshine tiny (English), moonshine-voice 0.0.62", "licence": "MIT"}
    save(encoder, out, ENCODER_FORMAT, about)
    typer.echo(f"wrote {out}")


if __name__ == "__main__":
    typer.run(main)
