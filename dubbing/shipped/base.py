"""The base checkpoints that ship with the package."""

from pathlib import Path

from dfrf.config import FROM_BASE

BASE = Path(__file__).with_name("base.safetensors")
PAPER_BASE = Path(__file__).with_name("paper_base.safetensors")  # of the method dfrf-paper
BASES = {**dict.fromkeys(FROM_BASE, BASE), "fast-paper": PAPER_BASE}


def shipped_base(preset: str) -> Path | None:
    """The shipped base for the presets that start from one; None for others."""
    base = BASES.get(preset)
    return base if base is not None and base.is_file() else None
