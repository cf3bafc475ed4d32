from __future__ import annotations

from pathlib import Path

import pytest

from tests import clips


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("manifest")
    clips.write_clip(place / "host.mp4", 75)
    clips.write_video(place / "silent.mp4", 75)
    clips.write_sound(place / "it.wav", 2)
    (place / "damaged.mp4").write_bytes(b"this is no video")
    return place
