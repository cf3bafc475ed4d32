"""Networks of other tools have as many parameters as was published, and give what they should."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from torch import nn

from dubbing.workshop.bench import other_networks as others
from dubbing.workshop.bench.benchmark import Tool, tool_table

pytestmark = pytest.mark.medium


TEXT = 768  # values of a vector that Stable Diffusion looks at


def stable_diffusion() -> nn.Module:
    return others.UNet(4, TEXT)


@pytest.mark.parametrize(
    ("build", "millions", "given", "wanted"),
    [
        (others.Wav2Lip, 36.3, [(2, 1, 80, 16), (2, 6, 96, 96)], (2, 3, 96, 96)),
        (stable_diffusion, 859.5, [(2, 4, 64, 64), (2, 320), (2, 77, TEXT)], (2, 4, 64, 64)),
        (lambda: others.UNet(8), 850, [(1, 8, 32, 32), (1, 320), (1, 50, 384)], (1, 4, 32, 32)),
        (lambda: others.UNet(13), 850, [(2, 13, 32, 32), (2, 320), (2, 50, 384)], (2, 4, 32, 32)),
        (others.decoder, 49.49, [(1, 4, 32, 32)], (1, 3, 256, 256)),
    ],
)
def test_sizes(
    build: Callable[[], nn.Module],
    millions: float,
    given: list[tuple[int, ...]],
    wanted: tuple[int, ...],
) -> None:
    with torch.device("meta"):  # shapes alone
        network = build().eval()
        assert network(*map(torch.zeros, given)).shape == wanted
    count = sum(parameter.numel() for parameter in network.parameters())
    assert count / 1e6 == pytest.approx(millions, rel=0.001)


def test_the_table_compares_with_our_frame() -> None:
    lines = tool_table([Tool("MuseTalk", 256, 1.4, 899_413_083)], ours=0.7).splitlines()
    assert lines[1].split() == ["MuseTalk", "256", "1.400", "x", "2.00", "899,413,083"]
