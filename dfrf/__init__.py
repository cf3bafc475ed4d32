"""Dynamic facial radiance fields: tensors in, tensors out.

The interface for researchers; `docs/development/researchers.md` shows it in a few lines. A name's
modules (torch above all) are loaded when the name is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dfrf.api import Head, fit_head, load_head, render_frame, save_head
    from dfrf.cameras import Camera
    from dfrf.config import TrainConfig
    from dfrf.data.dataset import HeadDataset
    from dfrf.method_interface import FrameInputs
    from dfrf.training.fit import FitOptions, fit

__all__ = [
    "Camera",
    "FitOptions",
    "FrameInputs",
    "Head",
    "HeadDataset",
    "TrainConfig",
    "fit",
    "fit_head",
    "load_head",
    "render_frame",
    "save_head",
]
_HOMES = {
    "dfrf.cameras": ["Camera"],
    "dfrf.config": ["TrainConfig"],
    "dfrf.data.dataset": ["HeadDataset"],
    "dfrf.api": ["Head", "fit_head", "load_head", "render_frame", "save_head"],
    "dfrf.method_interface": ["FrameInputs"],
    "dfrf.training.fit": ["FitOptions", "fit"],
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(home), name)
    raise AttributeError(f"module 'dfrf' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
