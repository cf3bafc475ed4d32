"""State of an unfinished run, saved so that a resumed run gives the same bits.

Weights, optimiser, random numbers, curve, and the measurements on people held out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import torch

from dfrf.checkpoint import MALFORMED_ERRORS, STATE_FILE, CheckpointError, load_state, save_state
from dfrf.config import FORMATS, TrainConfig
from dfrf.model_interface import HeadModel
from dfrf.training.progress import Curve
from dfrf.training.validation import Validation


@dataclass
class RunState:
    """Everything that changes during a run, and the settings that a saved state must agree in.

    Attributes:
        model, optimiser, generator, curve, validation: changed in place.
        config: settings of the run.
        about: more settings that must agree, plain data by name.
    """

    model: HeadModel
    optimiser: torch.optim.Optimizer
    generator: torch.Generator
    curve: Curve
    validation: Validation
    config: TrainConfig
    about: Mapping[str, Any]

    @property
    def settings(self) -> dict[str, Any]:
        """Settings that must be equal for a run to resume from another's state."""
        own = {
            "train": asdict(self.config),
            "config": asdict(self.model.config),
            "held": self.validation.names,
        }
        return {**own, **self.about}

    def save(self, folder: str, step: int) -> None:
        """Saves the state after `step` steps, in one file."""
        tensors = {f"model.{k}": v for k, v in self.model.state_dict().items()}
        for index, values in self.optimiser.state_dict()["state"].items():
            for name, value in values.items():
                tensors[f"optimiser.{index}.{name}"] = torch.as_tensor(value)
        tensors["generator"] = self.generator.get_state()
        tensors["curve"] = torch.tensor(self.curve.rows, dtype=torch.float64)
        tensors["held"] = torch.tensor(self.validation.rows, dtype=torch.float64)
        tensors |= {f"best.{k}": v for k, v in self.validation.best.items()}
        header = {"format": FORMATS[self.model.FAMILY], "step": step, **self.settings}
        save_state(folder, tensors, header)

    def load(self, folder: str) -> int:
        """Restores a run in place and returns its step; 0, and nothing is touched, without one.

        Raises:
            CheckpointError: unreadable, damaged, or of a run with other settings, which are named.
        """
        saved = load_state(folder, self.settings)
        if saved is None:
            return 0
        try:
            return self._restore(*saved)
        except MALFORMED_ERRORS as error:
            where = f"{folder}/{STATE_FILE}"
            raise CheckpointError(f"{where}: the state in it is damaged; remove it") from error

    def _restore(self, tensors: dict[str, torch.Tensor], header: dict[str, Any]) -> int:
        def part(name: str) -> dict[str, torch.Tensor]:
            start = f"{name}."
            return {k.removeprefix(start): v for k, v in tensors.items() if k.startswith(start)}

        self.model.load_state_dict(part("model"))
        self.validation.best = part("best")
        self.validation.rows = [tuple(row) for row in tensors["held"].tolist()]
        state = self.optimiser.state_dict()
        for name, value in part("optimiser").items():
            index, key = name.split(".")
            state["state"].setdefault(int(index), {})[key] = value
        self.optimiser.load_state_dict(state)
        self.generator.set_state(tensors["generator"])
        self.curve.rows = [(int(s), a, b, c) for s, a, b, c in tensors["curve"].tolist()]
        return int(header["step"])
