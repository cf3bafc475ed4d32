"""A short run of fit() on the tiny person, ended early where a test wants it."""

from __future__ import annotations

from itertools import count
from pathlib import Path

from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dfrf.training.fit import FitOptions, fit
from dfrf.training.progress import Curve
from dfrf.training.validation import Validation
from tests.dfrf.people import person


def run_fit(
    model: HeadModel,
    config: TrainConfig,
    resume: Path | None = None,
    steps: int | None = None,
    *,
    references: dict[str, Tensor] | None = None,
    validation: Validation | None = None,
) -> Curve:
    """Trains a model in place and ends after `steps` of this call; at the config's end if None."""
    done = count(1)
    return fit(
        method_of(model),
        [person()],
        config,
        references,
        FitOptions(
            resume=None if resume is None else str(resume),
            stop=lambda: next(done) == steps,
            device="cpu",
            validation=validation,
        ),
    )
