"""The card of the bases that ship says what the files hold."""

from __future__ import annotations

import json

from safetensors import safe_open
from safetensors.torch import load_file

from dubbing.shipped.base import BASE, PAPER_BASE

CARD = " ".join(BASE.with_name("BASE_CARD.md").read_text(encoding="utf-8").split())


def test_the_card_says_what_the_file_holds() -> None:
    with safe_open(BASE, "pt") as file:
        field = json.loads(file.metadata()["dfrf"])["config"]["field"]
    weights = sum(x.numel() for name, x in load_file(BASE).items() if name.startswith("field."))
    of = f"{field['references']} references of {field['reference_pool_size']}"
    assert f"(width {field['width']}, depth {field['depth']}, {of}, " in CARD
    assert f"{weights / 1e6:.2f} M weights" in CARD


def test_the_card_says_what_the_base_of_the_paper_holds() -> None:
    with safe_open(PAPER_BASE, "pt") as file:
        header = json.loads(file.metadata()["dfrf"])
    with safe_open(BASE, "pt") as file:
        same = json.loads(file.metadata()["dfrf"])["identities"]
    _, _, card = CARD.partition("## `paper_base.safetensors`")
    assert f"weights after {header['steps']:,} steps" in card
    (held_out,) = header["held_out"].values()
    assert f"{held_out:.2f} dB" in card
    assert header["identities"] == same  # "The same 25 people"
    field = header["config"]["field"]
    assert f"{field['references']} references of {field['reference_pool_size']}" in card
    assert not field["mouth_views"]
    assert not field["lip_supervision"]
