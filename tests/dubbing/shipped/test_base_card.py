"""The card of the base that ships says what the file holds."""

from __future__ import annotations

import json

from safetensors import safe_open
from safetensors.torch import load_file

from dubbing.shipped.base import BASE


def test_the_card_says_what_the_file_holds() -> None:
    card = " ".join(BASE.with_name("BASE_CARD.md").read_text(encoding="utf-8").split())
    with safe_open(BASE, "pt") as file:
        field = json.loads(file.metadata()["dfrf"])["config"]["field"]
    weights = sum(x.numel() for name, x in load_file(BASE).items() if name.startswith("field."))
    of = f"{field['references']} references of {field['reference_pool_size']}"
    assert f"(width {field['width']}, depth {field['depth']}, {of}, " in card
    assert f"{weights / 1e6:.2f} M weights" in card
