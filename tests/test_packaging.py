"""What a wheel, an sdist and the image of `Containerfile` hold."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TREE = (
    "dfrf",
    "dubbing",
    "manifests",
    "tests",
    "pyproject.toml",
    "MANIFEST.in",
    "README.md",
    "LICENSE",
)
DATA = (".safetensors", ".html", ".css", ".js", ".ttf", ".yaml", ".srt", ".md", ".json")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a wheel and an sdist, built from a copy without asking a registry."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for name in TREE:
        if (ROOT / name).is_dir():
            caches = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, source / name, ignore=caches)
        else:
            shutil.copy(ROOT / name, source)
    for kind in ("sdist", "wheel"):
        code = f"import sys; from setuptools import build_meta as b; b.build_{kind}(sys.argv[1])"
        call = [sys.executable, "-c", code, str(out)]
        subprocess.run(call, cwd=source, check=True, capture_output=True)
    return out


def shipped() -> set[str]:
    """Every file of both packages, and every manifest, that belongs into a wheel."""
    found = [path for name in ("dfrf", "dubbing", "manifests") for path in (ROOT / name).rglob("*")]
    return {p.relative_to(ROOT).as_posix() for p in found if p.suffix in (".py", *DATA)}


@pytest.mark.slow
def test_the_wheel_holds_both_packages_with_their_data_and_no_more(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    assert wheel.stat().st_size < 25e6
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        sizes = {info.filename: info.file_size for info in archive.infolist()}
        (points,) = (name for name in archive.namelist() if name.endswith("entry_points.txt"))
        assert "dfrf = dubbing.__main__:main" in archive.read(points).decode()
    # What is no package goes below the environment's own folder.
    places = {name: re.sub(r".*\.data/data/share/dfrf/", "", name) for name in names}
    assert set(places.values()) == shipped()
    assert sum(name.endswith(".safetensors") for name in names) >= 6
    wanted = {"report/page.html", "studio/page/main.js", "design/vendor/uplot.js"}
    assert {"manifests/demo.yaml", *(f"dubbing/{name}" for name in wanted)} <= {*places.values()}
    for name, place in places.items():
        assert sizes[name] == (ROOT / place).stat().st_size


@pytest.mark.slow
def test_the_sdist_holds_what_a_wheel_is_made_of(built: Path) -> None:
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", *shipped()} <= names
    assert not [name for name in names if name.startswith(("tests", "shared"))]


def instructions() -> list[tuple[str, list[str]]]:
    """Instruction and words of every line of `Containerfile`, in their order."""
    text = (ROOT / "Containerfile").read_text().replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [(words[0], words[1:]) for words in map(shlex.split, lines)]


def test_the_image_has_two_stages_and_ends_as_a_user() -> None:
    message = instructions()
    stages = [words for name, words in message if name == "FROM"]
    assert [words[2:] for words in stages] == [["install"], []]
    assert {words[0] for words in stages} == {"python:3.11-slim"}
    last = message[max(k for k, (name, _) in enumerate(message) if name == "FROM") :]
    (user,) = (words[0] for name, words in last if name == "USER")
    assert user not in ("root", "0")
    assert ("ENTRYPOINT", ["[dfrf]"]) in last


def test_what_the_image_copies_is_there_and_no_registry_is_named() -> None:
    earlier = {words[2] for name, words in instructions() if name == "FROM" and len(words) > 2}
    for name, words in instructions():
        if name != "COPY":
            continue
        if words[0].startswith("--from="):
            assert words[0].removeprefix("--from=") in earlier
            continue
        assert all((ROOT / source).exists() for source in words[:-1]), words
    text = (ROOT / "Containerfile").read_text()
    assert "://" not in text
    assert not re.search(r"\b[\w-]+\.(com|org|io|net)\b", text)
    ignored = (ROOT / ".containerignore").read_text().splitlines()
    copied = [source for name, w in instructions() if name == "COPY" for source in w[:-1]]
    for source in copied:
        if not source.startswith(("--from=", "/")):
            assert any(Path(source).match(line[1:]) for line in ignored if line[0] == "!"), source


def test_everything_is_installed_with_what_it_needs_as_it_was_tested() -> None:
    """No list of packages but the lock: `--no-deps` would need a second one."""
    places = ("Makefile", "Containerfile", "README.md", "CONTRIBUTING.md", ".ci/run")
    documents = [ROOT / name for name in places] + [*(ROOT / "docs").rglob("*.md")]
    assert not [path for path in documents if "--no-deps" in path.read_text(encoding="utf-8")]
    settings = [word for name, words in instructions() if name == "ENV" for word in words]
    assert "PIP_CONSTRAINT=/source/constraints.txt" in settings
    pins = (ROOT / "constraints.txt").read_text().splitlines()
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", line) for line in pins if line[0] != "#")
