"""Low imports high never: pure functions, the method, media and files, stages, pipeline, cli."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# From low to high. A module may import what is on its own line or above, never below.
LAYERS = (
    {"errors", "packages", "files", "kept", "overlap", "solution", "stage_names", "visible"},
    {"media", "voice", "timeline", "provenance", "shipped_base", "shipped_weights"},
    {"features", "acoustics", "speech", "yaml_lines", "entries", "inputs", "published", "messages"},
    {"overwriting"},
    {"manifest", "stages", "lock"},
    {"preparation", "sync", "speaker"},
    {"identity", "reference_choice", "compositing", "spoken", "flicker"},
    {"refining"},
    {"finetuning", "heads", "video"},
    {"tiles"},
    {"measuring", "timing"},
    {"steps"},
    {"jobs"},
    {"processes", "running", "planning", "machine", "starting"},
    {"report", "report_page"},
    {"pipeline"},
    {"evaluation", "basetraining", "benchmark", "teaching"},
    {"console"},
    {"arguments"},
    {"training_commands"},
    {"cli"},
    {"__main__"},
)
HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full name of everything a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def part(name: str) -> str:
    """``dubbing.media.probing.probe`` -> ``media``."""
    return name.split(".")[1] if "." in name else ""


@pytest.mark.parametrize("path", modules("dfrf"), ids=lambda p: p.stem)
def test_the_method_knows_nothing_of_the_batch(path: Path) -> None:
    for line, name in imported(path):
        package = name.split(".")[0]
        banned = ("dubbing", "yaml", "subprocess", "typer", "rich")
        assert package not in banned, f"{path.name}:{line} imports {name}"


@pytest.mark.parametrize("path", modules("dubbing"), ids=lambda p: p.stem)
def test_low_imports_high_never(path: Path) -> None:
    own = path.relative_to(ROOT / "dubbing").parts[0].removesuffix(".py")
    if own == "__init__":
        return
    assert own in HEIGHT, f"give dubbing.{own} a place in LAYERS"
    for line, name in imported(path):
        if name.startswith("dubbing."):
            other = part(name)
            assert HEIGHT.get(other, -1) <= HEIGHT[own], f"{path.name}:{line} imports {name}"
        assert not name.startswith("tests"), f"{path.name}:{line} imports {name}"


def test_only_media_runs_programs() -> None:
    allowed = {"media", "speaker", "teaching"}  # flite and festival speak
    for path in modules("dubbing"):
        if path.relative_to(ROOT / "dubbing").parts[0] not in allowed:
            for line, name in imported(path):
                assert not name.startswith(("subprocess", "ffmpeg")), f"{path.name}:{line}"


@pytest.mark.parametrize(
    "module",
    [
        "dubbing.cli.main",
        "dubbing.engine.planner",
        "dubbing.manifest.manifest",
        "dubbing.cli.console",
    ],
)
def test_loading_it_loads_no_torch(module: str) -> None:
    code = f"import sys, {module}; sys.exit(any(m in sys.modules for m in ('torch', 'mediapipe')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
