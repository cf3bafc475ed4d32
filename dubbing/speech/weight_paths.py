"""Paths of the weights of speech features; a module without torch, so that manifests load fast."""

from pathlib import Path
from typing import Any

from dubbing.engine.disk import json_records
from dubbing.errors import ExplainedError

DEFAULT_WEIGHTS = Path(__file__).with_name("acoustic_weights.safetensors")
VOICE_DETECTOR = Path(__file__).with_name("voice_detector.safetensors")
DEEPSPEECH_GRAPH = "output_graph.pb of DeepSpeech 0.1.0 (deepspeech-0_1_0-b90017e8.pb)"
WEIGHT_FILES = ("model.safetensors", "pytorch_model.bin", "model.safetensors.index.json")


def weights_file(folder: Path, name: str) -> Path:
    """The file with the weights in `folder`.

    Raises:
        ExplainedError: it is missing, or of another kind of network.
    """
    remedy = f"name the folder of a {name} model written by transformers' save_pretrained"
    config = folder / "config.json"
    present = [folder / file for file in WEIGHT_FILES if (folder / file).is_file()]
    if not config.is_file() or not present:
        raise ExplainedError(f"no {name} weights there", str(folder), remedy)
    kind = json_records.read(config, dict[str, Any], "config.json", remedy).get("model_type")
    if kind != name:
        raise ExplainedError(f"holds a model of type {kind!r}, not {name!r}", str(folder), remedy)
    return present[0]


def files_of(folder: Path) -> dict[str, Path]:
    """The files of a model's folder, by name: its weights, in parts or whole, and its settings."""
    paths = {path.name: path for path in folder.iterdir() if path.is_file()}
    return {name: paths[name] for name in sorted(paths) if not name.startswith(".")}
