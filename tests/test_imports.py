"""Rooms import rooms further down only: read off the folders, wherever an import stands."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from importlib.util import resolve_name
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("dfrf", "dubbing")
ENGINE = "dubbing.engine"


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full name of everything a file imports, in functions and for mypy alone too.

    Imports inside of the engine alone are relative: it can be copied.
    """
    package = ".".join(path.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            engine = package == ENGINE or package.startswith(f"{ENGINE}.")
            assert not node.level or engine, f"{path}:{node.lineno}: relative import"
            base = resolve_name("." * node.level + (node.module or ""), package)
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def room(name: str) -> str:
    """The room of a dotted name: its folder, or the module itself where it lies at the top.

    ``dfrf.field.warp.Warp`` -> ``dfrf.field``, ``dfrf.config.FORMATS`` -> itself.
    """
    parts = name.split(".")
    while parts:
        at = ROOT.joinpath(*parts)
        if at.with_suffix(".py").is_file():
            return ".".join(parts[:-1]) if len(parts) > 2 else ".".join(parts)
        if at.is_dir():
            return ".".join(parts)
        parts.pop()
    return ""


def rooms(package: str) -> dict[str, dict[str, str]]:
    """Room -> the rooms it imports, each with one of the places where it does."""
    graph: dict[str, dict[str, str]] = {}
    for path in modules(package):
        own = room(".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"))
        if own == package:
            continue  # the door, which opens every room when it is asked to
        entry = graph.setdefault(own, {})
        for line, name in imported(path):
            other = room(name)
            if name.split(".")[0] == package and other not in (own, package):
                entry.setdefault(other, f"{path.relative_to(ROOT)}:{line} imports {name}")
    return graph


@pytest.mark.parametrize("package", PACKAGES)
def test_no_rooms_import_one_another(package: str) -> None:
    graph = rooms(package)
    assert len(graph) > 5
    try:
        TopologicalSorter({own: set(others) for own, others in graph.items()}).prepare()
    except CycleError as error:
        ring = error.args[1]
        places = [graph[b][a] for a, b in pairwise(ring)]
        pytest.fail("rooms import one another:\n" + "\n".join(places))


@pytest.mark.parametrize("package", PACKAGES)
def test_no_files_import_one_another(package: str) -> None:
    """Not even for mypy alone. Doors of packages, which gather what is in them, do not count."""
    files = {p.relative_to(ROOT).with_suffix(""): p for p in modules(package)}
    names = {".".join(f.parts): p for f, p in files.items() if f.name != "__init__"}
    graph = {
        own: {
            other
            for _, name in imported(path)
            for other in (name, name.rpartition(".")[0])
            if other in names and other != own
        }
        for own, path in names.items()
    }
    assert sum(map(len, graph.values())) > len(graph)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail("files import one another: " + " -> ".join(reversed(error.args[1])))


def test_a_cycle_would_be_found() -> None:
    with pytest.raises(CycleError):
        TopologicalSorter({"a": {"b"}, "b": {"c"}, "c": {"a"}}).prepare()
    assert room("dfrf.field.warp.Warp") == "dfrf.field"
    assert room("dfrf.config.FORMATS") == "dfrf.config"
    assert "dfrf.field" in rooms("dfrf")["dfrf.rendering"]


@pytest.mark.parametrize("path", modules("dfrf"), ids=lambda p: p.stem)
def test_the_method_knows_nothing_of_the_batch(path: Path) -> None:
    for line, name in imported(path):
        package = name.split(".")[0]
        banned = ("dubbing", "ruamel", "subprocess", "typer", "rich")
        assert package not in banned, f"{path.name}:{line} imports {name}"


@pytest.mark.parametrize("path", [p for q in PACKAGES for p in modules(q)], ids=lambda p: p.stem)
def test_no_package_imports_its_tests(path: Path) -> None:
    for line, name in imported(path):
        assert not name.startswith("tests"), f"{path.name}:{line} imports {name}"


@pytest.mark.parametrize("path", modules("dubbing/engine"), ids=lambda p: p.stem)
def test_the_engine_knows_nothing_of_dubs(path: Path) -> None:
    """It names itself relatively, and needs two packages from elsewhere."""
    elsewhere = {"pydantic", "typing_extensions", "distributed"}
    tree = ast.parse(path.read_text(encoding="utf-8"))
    relative = {n.lineno for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.level}
    for line, name in imported(path):
        place = f"{path.name}:{line} imports {name}"
        if line in relative:
            assert name.startswith(f"{ENGINE}."), place
        else:
            assert name.split(".")[0] in {*sys.stdlib_module_names} | elsewhere, place


WORKSHOP = "dubbing.workshop"


@pytest.mark.parametrize("path", modules("dubbing"), ids=lambda p: p.stem)
def test_no_dub_needs_the_workshop(path: Path) -> None:
    """Nothing outside imports it; its commands load it when they are called."""
    own = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    if own.startswith(WORKSHOP):
        return
    tree = ast.parse(path.read_text(encoding="utf-8"))
    in_functions = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [getattr(node, "module", None) or "", *(alias.name for alias in node.names)]
            if any(name.startswith(WORKSHOP) for name in names):
                lazily = own.startswith("dubbing.cli") and node in in_functions
                assert lazily, f"{path.name}:{node.lineno}: no dub needs {names}"


def test_only_some_rooms_run_programs() -> None:
    # flite and festival speak; a task is a process of our own; what is timed is run as users do,
    # and the studio runs `dfrf dub` so
    allowed = {
        "dubbing.media.opening",
        "dubbing.engine.running",
        "dubbing.studio",
        "dubbing.workshop.bench",
        "dubbing.workshop.synthetic",
        "dubbing.workshop.training.speech",
    }
    for path in modules("dubbing"):
        own = room(".".join(path.relative_to(ROOT).with_suffix("").parts))
        if own not in allowed:
            for line, name in imported(path):
                assert not name.startswith(("subprocess", "ffmpeg")), f"{path.name}:{line}"


@pytest.mark.parametrize(
    "module",
    [
        "dfrf",
        "dubbing.cli.main",
        "dubbing.engine.planning.planner",
        "dubbing.manifest.manifest",
        "dubbing.cli.console",
        "dubbing.studio.server",
    ],
)
def test_loading_it_loads_no_torch(module: str) -> None:
    code = f"import sys, {module}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
