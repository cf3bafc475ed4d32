"""Findings of `doctor` about the networks that ship: whether they compute here what they should.

Those that find faces and people hold results of a test image. The others are run twice on the same
noise: as in a dub, and in double precision on the processor.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dubbing import packages
from dubbing.cli.doctor.finding import Finding
from dubbing.errors import ExplainedError

if TYPE_CHECKING:
    from torch import Tensor

CLOSE = 0.01  # of the largest result: graphics cards round to .001
SECONDS = 2  # of sound


def self_tests() -> list[Finding]:
    """A finding for each network, or group of them."""
    return [_finding(name, test) for name, test in TESTS.items()]


def _finding(name: str, test: Callable[[], str]) -> Finding:
    try:
        wrong = test()
    except ImportError as error:
        command = packages.command([error.name or "torch"])
        return Finding(name, "lacking", f"{error.name} is not installed", command)
    except ExplainedError as error:
        return Finding(name, "lacking", error.what, packages.again("dfrf"))
    if not wrong:
        return Finding(name, "fine", "computes what it should")
    text = f"other results than it should give: {wrong}"
    return Finding(name, "lacking", text, packages.again("torch"))


def _faces() -> str:
    from dubbing.face.finding.graph_network import GraphNetwork
    from dubbing.face.weight_paths import FACE_WEIGHTS, HAND_WEIGHTS, PERSON_WEIGHTS

    paths = FACE_WEIGHTS | HAND_WEIGHTS | PERSON_WEIGHTS
    return ", ".join(name for name, path in paths.items() if not GraphNetwork(path).works())


def _voice() -> str:
    import torch

    from dubbing.speech.voice_detector import CHUNK, CONTEXT, load

    chunks = torch.randn(SECONDS * 31, CONTEXT + CHUNK) / 10
    return _compared(load(), lambda network, x: network(x, None)[0], chunks)


def _features() -> str:
    import torch

    from dubbing.speech.acoustic_input import BANDS, SPECTRA
    from dubbing.speech.acoustic_weights import load_model

    spectra = torch.randn(1, SECONDS * 50, SPECTRA * BANDS)
    return _compared(load_model().network, lambda network, x: network(x).senones, spectra)


def _lips() -> str:
    import torch

    from dubbing.sound_to_lips.encoder import AFTER, BEFORE, STEP
    from dubbing.sound_to_lips.lip_network import load

    samples = torch.randn(SECONDS * 40 * STEP + BEFORE + AFTER) / 10
    return _compared(load(), lambda network, x: network.filter(network.encoder(x)), samples)


def _sync() -> str:
    import torch

    from dubbing.sync.network.channels import WIDTH
    from dubbing.sync.network.sync_network import load_network

    sounds = torch.randn(SECONDS * 50, 10, WIDTH)
    return _compared(load_network(), lambda network, x: network.embed_sound(x), sounds)


def _base() -> str:
    import torch

    from dfrf.device import choose
    from dfrf.fast.fast_model import FastModel
    from dfrf.saved_models import load_model
    from dubbing.shipped.base import BASE

    if not BASE.is_file():
        raise ExplainedError("the file is gone", str(BASE))
    model, _ = load_model(BASE)
    assert isinstance(model, FastModel)

    def density(field: Any, x: Tensor) -> Tensor:
        x = field.input(x).relu()
        for layer in field.hidden:
            x = layer(x).relu()
        return torch.as_tensor(field.density(x))

    points = torch.randn(4096, model.field.input.in_features)
    return _compared(model.field, density, points, choose("auto"))


def _compared(
    network: Any, run: Callable[[Any, Tensor], Tensor], x: Tensor, on: Any = "cpu"
) -> str:
    """How far results are from those of double precision, where that is too far."""
    import torch

    with torch.no_grad():
        exact = run(copy.deepcopy(network).double(), x.double())
        found = run(network.to(on), x.to(on)).double().cpu()
    error = float((found - exact).abs().max() / exact.abs().max())
    return "" if error < CLOSE else f"{100 * error:.1f} % off"


TESTS = {
    "face networks": _faces,
    "voice detector": _voice,
    "speech features": _features,
    "lips from speech": _lips,
    "sync check": _sync,
    "base checkpoint": _base,
}
