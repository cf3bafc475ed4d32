"""Which arithmetic is chosen on which processor, and what it changes."""

from __future__ import annotations

import pytest
import torch

from dfrf import device

CPU = torch.device("cpu")


@pytest.mark.parametrize(("processor", "wanted"), [("neither", 0), ("AVX512-BF16", 1), ("AMX", 1)])
def test_bfloat16_is_chosen_where_it_is_faster(
    processor: str, wanted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cpu, "_is_amx_tile_supported", lambda: processor == "AMX")
    monkeypatch.setattr(torch.cpu, "_is_avx512_bf16_supported", lambda: processor != "neither")
    assert device.has_bfloat16(CPU) == wanted
    with torch.no_grad():  # rendering
        assert device.has_bfloat16(CPU) == wanted


def test_products_are_rounded_as_the_tables_are(arithmetic: float) -> None:
    one, other = torch.rand(64, 64), torch.rand(64, 64)
    exact = one.double() @ other.double()
    kind = {2.0**-24: torch.float32, 2.0**-8: torch.bfloat16}[arithmetic]
    assert device.table_type(CPU) == kind
    assert device.matrix_type(CPU) == torch.float32  # outside of it
    with device.arithmetic(CPU):
        assert device.matrix_type(CPU) == kind
        product = one @ other
    assert product.dtype == kind
    # Both factors are rounded, and their product.
    error = ((product.double() - exact) / exact).abs()
    assert error.max() < 3 * arithmetic + 64 * 2.0**-24
    assert error.max() > arithmetic / 4


def test_counts_are_filled_up_to_round_ones() -> None:
    for count in (0, 1, 511, 512, 513):
        whole = count + device.padding(count)
        assert whole % device.PADDED_MULTIPLE == 0
        assert 0 <= device.padding(count) < device.PADDED_MULTIPLE
