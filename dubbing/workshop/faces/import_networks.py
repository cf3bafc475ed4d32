"""Writes the networks that find faces, hands and people, from the files of MediaPipe 0.10.21.

    python -m dubbing.workshop.faces.import_networks WHEEL --out dubbing/face

WHEEL is the wheel of the package, or the folder `mediapipe` of an installed one. Also needs the
package flatbuffers (the extra `dev`).
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path
from typing import Annotated

import torch
import typer

from dubbing.face.finding.graph_network import FORMAT, GraphNetwork
from dubbing.shipped.weights import save_half
from dubbing.workshop.faces.conversion import convert
from dubbing.workshop.faces.flatbuffer import read_graph
from dubbing.workshop.faces.parallel import merged, without_repetitions

# File of a network here, and in the package.
NETWORKS = {
    "face_detector": "modules/face_detection/face_detection_short_range.tflite",
    "face_landmarks": "modules/face_landmark/face_landmark_with_attention.tflite",
    "hand_detector": "modules/palm_detection/palm_detection_lite.tflite",
    "hand_landmarks": "modules/hand_landmark/hand_landmark_lite.tflite",
    "person_mask": "modules/selfie_segmentation/selfie_segmentation.tflite",
}


def read_source(package: Path, name: str) -> bytes:
    """A file of a wheel or of an installed package."""
    if package.is_dir():
        return (package / name).read_bytes()
    with zipfile.ZipFile(package) as wheel:
        return wheel.read(f"mediapipe/{name}")


def import_network(data: bytes, source: str, path: Path) -> None:
    """Write a TFLite file's network to `path`."""
    graph = read_graph(data)
    steps, outputs, weights = convert(graph)
    steps = without_repetitions(steps, weights)
    steps = merged(steps, outputs, weights)
    side = graph.shapes[graph.inputs[0]][1]
    stored = {"input": graph.inputs[0], "side": side, "outputs": outputs, "steps": steps}
    header = {
        "format": FORMAT,
        "graph": json.dumps(stored, separators=(",", ":")),
        "source": Path(source).name,
        "source_sha256": hashlib.sha256(data).hexdigest(),
        "license": "Apache-2.0",
    }
    tensors = {name: torch.from_numpy(value.copy()) for name, value in weights.items()}
    save_half(tensors, path, header)
    header["expected"] = json.dumps(GraphNetwork(path).test_results())
    save_half(tensors, path, header)


def main(
    package: Annotated[Path, typer.Argument(help="Wheel or folder of mediapipe 0.10.21.")],
    out: Annotated[Path, typer.Option(help="Folder for the networks.")],
) -> None:
    """Imports all networks."""
    for name, source in NETWORKS.items():
        path = out / f"{name}.safetensors"
        import_network(read_source(package, source), source, path)
        print(f"{path}: {path.stat().st_size / 2**20:.2f} MiB")


if __name__ == "__main__":
    typer.run(main)
