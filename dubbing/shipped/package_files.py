"""Weights that come with other packages."""

from importlib.util import find_spec
from pathlib import Path


def of_package(package: str, *files: str) -> dict[str, Path]:
    """Weights that come with another package, by name; it is not imported."""
    found = find_spec(package)
    if found is None or found.origin is None:
        return {}
    return {f"{package} {Path(name).stem}": Path(found.origin).parent / name for name in files}
