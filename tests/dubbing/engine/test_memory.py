"""Systems count memory in different units, or not at all."""

import resource
import sys
from types import SimpleNamespace

import pytest

from dubbing.engine.memory import peak_memory


def test_it_is_known_here() -> None:
    assert (peak_memory() or 0) > 2**20


@pytest.mark.parametrize(("system", "unit"), [("linux", 1024), ("darwin", 1)])
def test_it_is_in_bytes(system: str, unit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = SimpleNamespace(ru_maxrss=3000)
    monkeypatch.setattr(resource, "getrusage", lambda _: usage)
    monkeypatch.setattr(sys, "platform", system)
    assert peak_memory() == 3000 * unit


def test_without_the_module_of_unix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resource", None)
    assert peak_memory() is None
