from __future__ import annotations

from pathlib import Path

import pytest

from tests.dubbing.rating import versions


@pytest.fixture(scope="package")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Manifests of two versions of the same dubs, which tests leave as they are."""
    place = tmp_path_factory.mktemp("versions")
    return versions.write(place / "old"), versions.write(place / "secret", first_frames=40)
