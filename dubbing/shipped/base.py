"""The base checkpoint that comes with the package."""

from pathlib import Path

from dfrf.config import FROM_BASE

BASE = Path(__file__).with_name("base.safetensors")


def shipped_base(preset: str) -> Path | None:
    """The checkpoint for the preset it was trained as and its ablations; None for others."""
    return BASE if preset in FROM_BASE and BASE.is_file() else None
