import os
import stat
from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import DubbingError
from dubbing.provenance import mark_key


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "settings"
    monkeypatch.setattr(mark_key.typer, "get_app_dir", lambda _name: str(folder))
    return folder


def test_the_key_of_the_installation_is_made_once_and_for_its_owner_alone(settings: Path) -> None:
    file = mark_key.make_installation_key()
    first = mark_key.read_key(file)
    assert mark_key.read_key(mark_key.make_installation_key()) == first
    assert [path.name for path in settings.iterdir()] == [file.name]
    if os.name == "posix":
        assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_a_marking_writes_nothing_and_shows_no_key(settings: Path) -> None:
    assert mark_key.marking(None, ["clip", "audio"]).fingerprint == ""
    assert not settings.exists()
    file = mark_key.make_installation_key()
    known = mark_key.marking(None, ["clip", "audio"])
    assert known.key() == mark_key.read_key(file)
    assert known.fingerprint not in known.key().hex()
    assert known.id != mark_key.marking(None, ["clip", "other audio"]).id


def test_a_key_that_changed_during_a_run_is_noticed(tmp_path: Path) -> None:
    file = tmp_path / "own.key"
    file.write_bytes(b"one secret of ours")
    known = mark_key.marking(file, [])
    file.write_bytes(b"another one of ours")
    with pytest.raises(DubbingError, match="another key"):
        known.key()


@pytest.mark.parametrize("content", [b"", b"short", None])
def test_a_file_that_is_no_key_is_refused(tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "own.key"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(DubbingError, match="key") as refused:
        mark_key.read_key(file)
    assert refused.value.remedy


def test_bits_and_their_digits() -> None:
    bits = mark_key.bits_of("80000000000000f1")
    assert bits[0] == 1
    assert bits.sum() == 6
    assert mark_key.id_of(np.asarray(bits)) == "80000000000000f1"
