"""One short clip that the tests of the speaker share."""

from pathlib import Path

import pytest

from dubbing.workshop.synthetic.speaker import SpeakerTruth, make_speaker

TEXT = "Papa bought five maps, my warm umbrella, and a big apple."


@pytest.fixture(scope="session")
def clip(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SpeakerTruth]:
    """A clip of 256 px and what is true in it."""
    folder = tmp_path_factory.mktemp("speaker")
    return folder, make_speaker(folder, text=TEXT, seconds=3.0, size=256, seed=3)
