"""A folder of films for a cut, and the recording along it."""

from pathlib import Path

import pytest

from tests import clips


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    # Where the library is missing, tests that ask for this are skipped.
    from tests.dubbing.timelines.cuts import FILM_RATE, use

    use(monkeypatch, FILM_RATE)
    for k in range(7):
        (tmp_path / f"shot{k}.mov").touch()
    clips.write_noise(tmp_path / "cut_it.wav", 30, 16000)
    return tmp_path
