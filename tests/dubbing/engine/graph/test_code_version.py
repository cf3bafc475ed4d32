"""A stage is out of date when its code changes, and not when its words do."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path

import pytest

from dubbing.engine.graph import code_version as versions

Write = Callable[[str, str], None]
PACKAGES = ("made",)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Writes modules of a package `made`."""
    folder = tmp_path / "made"
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))

    moments = count(1)

    def write(name: str, text: str) -> None:
        (folder / f"{name}.py").write_text(text)
        os.utime(folder / f"{name}.py", (0, next(moments)))  # two writes may have one time
        versions.code_version.cache_clear()
        versions._parsed.cache_clear()
        versions.file_of.cache_clear()

    return write


def test_it_follows_imports_even_those_inside_of_functions(package: Write) -> None:
    package("low", "def f(x):\n    return x + 1\n")
    package("high", "def g(x):\n    from made.low import f\n    return f(x)\n")
    before = versions.code_version("made.high", PACKAGES)
    package("low", "def f(x):\n    return x + 2\n")
    assert versions.code_version("made.high", PACKAGES) != before
    assert "made" not in sys.modules  # nothing was executed


def test_relative_imports_are_followed(package: Write) -> None:
    package("low", "A = 1\n")
    package("high", "from .low import A\n")
    package("higher", "from . import high\n")
    before = versions.code_version("made.higher", PACKAGES)
    package("low", "A = 2\n")
    assert versions.code_version("made.higher", PACKAGES) != before
    assert versions.reachable("made.higher", PACKAGES) == {
        "made",
        "made.higher",
        "made.high",
        "made.low",
    }


def test_a_module_may_lie_in_no_package(package: Write, tmp_path: Path) -> None:
    (tmp_path / "alone.py").write_text("import json\nfrom made.low import A\n")
    package("low", "A = 1\n")
    names = ("alone", "made", "json")
    assert {"alone", "made.low", "json"} <= versions.reachable("alone", names)


def test_comments_docstrings_and_layout_do_not_count(package: Write) -> None:
    package("one", "def f(x):\n    return (x, 1)\n")
    before = versions.code_version("made.one", PACKAGES)
    package(
        "one", '"""Words."""\n# more\ndef f(x):\n    """Other words."""\n    return (\n x, 1)\n'
    )
    assert versions.code_version("made.one", PACKAGES) == before


def test_other_modules_do_not_count(package: Write) -> None:
    package("one", "A = 1\n")
    package("two", "B = 1\n")
    before = versions.code_version("made.one", PACKAGES)
    package("two", "B = 2\n")
    assert versions.code_version("made.one", PACKAGES) == before


def test_two_modules_that_import_each_other_end(package: Write) -> None:
    package("one", "from made import two\nA = 1\n")
    package("two", "from made import one\n")
    assert versions.code_version("made.one", PACKAGES)
