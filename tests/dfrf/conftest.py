"""The same random numbers in every run and in every order of the tests; and both arithmetics."""

import pytest
import torch

from dfrf import device

# Half the distance between neighbouring numbers of 8 significant bits, relative: one rounding.
ROUNDING = {"float32": 2.0**-24, "bfloat16": 2.0**-8}


@pytest.fixture(autouse=True)
def seed() -> None:
    torch.manual_seed(0)


@pytest.fixture(params=list(ROUNDING))
def arithmetic(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> float:
    """Matrix products in float32, then in bfloat16, whatever this machine does faster.

    Gives the relative error of one rounding in it.
    """
    kind: str = request.param
    monkeypatch.setattr(device, "has_bfloat16", lambda _: kind == "bfloat16")
    return ROUNDING[kind]
