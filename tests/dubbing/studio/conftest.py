"""A scene that can be drafted, with its film and its stages made once."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests import fakes
from tests.dubbing.batches import dub
from tests.dubbing.studio.browser import Browser, Page
from tests.dubbing.studio.pages import opened
from tests.dubbing.studio.stand_in import TOKEN, client_of, server, write_scene


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a manifest whose people are learned."""
    manifest = write_scene(tmp_path_factory.mktemp("studio"))
    with pytest.MonkeyPatch.context() as patch:
        fakes.install(patch.setattr)
        dub(manifest, draft=True)
    return manifest.parent


@pytest.fixture
def manifest(made: Path, tmp_path: Path) -> Path:
    """A copy of it, for one test."""
    shutil.copytree(made, tmp_path / "scene")
    return tmp_path / "scene" / "m.yaml"


@pytest.fixture
def stranger(manifest: Path) -> Iterator[TestClient]:
    with client_of(manifest) as client:
        yield client


@pytest.fixture
def client(stranger: TestClient) -> TestClient:
    assert stranger.get(f"/?token={TOKEN}").status_code == 303
    return stranger


@pytest.fixture
def address(manifest: Path) -> Iterator[str]:
    with server(manifest) as found:
        yield found


@pytest.fixture
def page(chromium: Browser, address: str) -> Page:
    return opened(chromium, address)
