"""Files of the package's own small networks: half precision, with a format in the header."""

from collections.abc import Mapping
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor

from dubbing.engine.disk.files import atomic_path
from dubbing.errors import ExplainedError


def save_half(tensors: Mapping[str, Tensor], path: Path, header: dict[str, str]) -> None:
    """Write tensors in half precision; `header` holds at least `format`."""
    halves = {name: value.detach().half().contiguous() for name, value in tensors.items()}
    with atomic_path(path) as temporary:
        save_file(halves, temporary, header)
        # safetensors makes files that only their owner may read; weights are for everyone.
        temporary.chmod(0o644)


def load_float(
    path: Path, form: str, what: str, remedy: str, error: type[ExplainedError] = ExplainedError
) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Read tensors as float32, and the header.

    Args:
        form: the `format` that the header must name.
        what: name of the network, for messages: speech, sync.

    Raises:
        ExplainedError: of the class `error`: the file is missing, damaged or of another format.
    """
    try:
        with safe_open(path, "pt") as file:
            header = file.metadata() or {}
    except (OSError, SafetensorError) as problem:
        raise error(f"{what} weights cannot be read: {problem}", str(path), remedy) from problem
    if header.get("format") != form:
        raise error(f"these are not weights of our {what} network", str(path), remedy)
    return {name: value.float() for name, value in load_file(path).items()}, header
