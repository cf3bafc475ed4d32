"""The scene that most tests of finished videos use."""

from pathlib import Path

import pytest

from tests.dubbing.video.scene import Scene


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return Scene(tmp_path, 12)
