"""Before any test imports dfrf: the shapes in its signatures are checked."""

import os
import tempfile

import pytest
from jaxtyping import install_import_hook

from tests.shapes import BUDGET

install_import_hook(["dfrf"], "tests.shapes.checked")

# The key of the invisible mark that tests make, and caches: not in the folders of who runs them.
SETTINGS = tempfile.TemporaryDirectory()
os.environ["XDG_CONFIG_HOME"] = os.environ["XDG_CACHE_HOME"] = SETTINGS.name


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Before the fixtures of a test."""
    BUDGET.begin()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The slow tests come first: one that begins last would be waited for by an idle process."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
