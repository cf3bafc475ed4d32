"""Rates of this machine: how long one unit of a stage's work takes on it."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import atomic_write_json
from dubbing.engine.graph.stage import Rate
from dubbing.homes import cache_folder


def rates_file() -> Path | None:
    """The file that keeps the rates of this machine; None for a user without a home."""
    folder = cache_folder()
    return folder / "rates.json" if folder else None


def calibrated() -> dict[str, Rate]:
    """Rates of this machine as `dfrf doctor --calibrate` measured them; none where it did not."""
    path = rates_file()
    return json_records.read_or({}, path, dict[str, Rate]) if path else {}


def keep(rates: Mapping[str, Rate]) -> Path:
    """Write the rates of this machine; gives the file."""
    path = rates_file()
    assert path is not None  # `doctor` has looked
    atomic_write_json(path, {name: asdict(rate) for name, rate in rates.items()})
    return path
