"""The same random numbers in every run and in every order of the tests; and both arithmetics."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import torch

from dfrf import device

# Half the distance between neighbouring numbers of 8 significant bits, relative: one rounding.
ROUNDING = {"float32": 2.0**-24, "bfloat16": 2.0**-8}


@pytest.fixture(autouse=True)
def seed() -> None:
    torch.manual_seed(0)


@contextmanager
def forced(kind: str) -> Iterator[float]:
    """Matrix products and tables in `float32` or `bfloat16`, whatever this machine does faster.

    Gives the relative error of one rounding in it.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(device, "has_bfloat16", lambda _: kind == "bfloat16")
        yield ROUNDING[kind]


@pytest.fixture(params=list(ROUNDING))
def arithmetic(request: pytest.FixtureRequest) -> Iterator[float]:
    """A test in one arithmetic, then in the other; see `forced`."""
    with forced(request.param) as rounding:
        yield rounding
