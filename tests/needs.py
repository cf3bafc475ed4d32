"""Things that some tests need and not every machine has: without them a test is skipped."""

from __future__ import annotations

import os
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
INSTALL = "no Chromium to open the report: apt-get install chromium"


def chromium() -> str:
    """Path of the browser. Where `DFRF_NEEDS_CHROMIUM` is set, its absence is a failure."""
    found = next(filter(None, map(shutil.which, PROGRAMS)), "")
    if not found and os.environ.get("DFRF_NEEDS_CHROMIUM"):
        pytest.fail(INSTALL)
    return found or pytest.skip(INSTALL)


def mediapipe() -> Path:
    """Folder of the library that the networks for faces come from, which can then be imported.

    It has an environment of its own (see the Makefile), where these tests look last.
    """
    for packages in (ROOT / ".venv/parity").glob("lib/python*/site-packages"):
        if str(packages) not in sys.path:
            sys.path.append(str(packages))
    package = find_spec("mediapipe")
    if package is None or package.origin is None:
        pytest.skip("mediapipe is not installed", allow_module_level=True)
    return Path(package.origin).parent


def shared(name: str) -> Path:
    """File or folder of `shared/` beside the clone: real clips, published numbers."""
    path = ROOT.parent / "shared" / name
    if not path.exists():
        pytest.skip(f"shared/{name} is not beside the repository")
    return path
