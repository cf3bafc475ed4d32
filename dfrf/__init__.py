"""Dynamic facial radiance fields: tensors in, tensors out.

The door for researchers; `docs/researchers.md` shows it in ten lines. What a name needs (torch
above all) is loaded when the name is first used.
"""

from __future__ import annotations

import importlib
from typing import Any

_HOMES = {
    "Camera": "dfrf.cameras",
    "FitOptions": "dfrf.training.fit",
    "FrameInputs": "dfrf.method",
    "Head": "dfrf.head",
    "HeadDataset": "dfrf.data",
    "TrainConfig": "dfrf.config",
    "fit": "dfrf.training.fit",
    "fit_head": "dfrf.head",
    "load_head": "dfrf.head",
    "render_frame": "dfrf.head",
    "save_head": "dfrf.head",
}
__all__ = [*_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'dfrf' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
