"""The base checkpoint that ships with the package."""

from pathlib import Path

from dfrf.config import FROM_BASE

BASE = Path(__file__).with_name("base.safetensors")


def shipped_base(preset: str) -> Path | None:
    """The shipped base for the presets that start from it; None for others."""
    return BASE if preset in FROM_BASE and BASE.is_file() else None
