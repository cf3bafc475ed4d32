import os
import pwd
import stat
from pathlib import Path

import numpy as np
import pytest

from dubbing.batch.rates import calibrated, rates_file
from dubbing.errors import CallError, ExplainedError
from dubbing.provenance import mark_key


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "settings"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(folder))
    return folder / "dfrf"


def test_the_key_of_the_installation_is_made_once_and_for_its_owner_alone(settings: Path) -> None:
    file = mark_key.make_installation_key()
    first = mark_key.read_key(file)
    assert mark_key.read_key(mark_key.make_installation_key()) == first
    assert [path.name for path in settings.iterdir()] == [file.name]
    if os.name == "posix":
        assert stat.S_IMODE(file.stat().st_mode) == 0o600


@pytest.mark.parametrize("home", [None, "", "~", "here"])
def test_without_a_home_there_is_no_key_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: str | None
) -> None:
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", lambda uid: {"nobody": ""}[str(uid)])
    monkeypatch.delenv("HOME") if home is None else monkeypatch.setenv("HOME", home)
    monkeypatch.chdir(tmp_path)
    assert mark_key.installation_file() is None
    assert rates_file() is None
    assert calibrated() == {}
    known = mark_key.marking(None, ["clip"])
    assert known.fingerprint == ""
    with pytest.raises(ExplainedError, match=r"no home folder.*mark: \{key: FILE\}"):
        known.key()
    with pytest.raises(CallError, match=r"no home folder.*mark: \{key: FILE\}"):
        mark_key.make_installation_key()
    assert not list(tmp_path.iterdir())


def test_a_home_that_cannot_be_written_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "file"))
    with pytest.raises(CallError, match=r"mark: \{key: FILE\}"):
        mark_key.make_installation_key()


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
    with pytest.raises(ExplainedError, match="another key"):
        known.key()


@pytest.mark.parametrize("content", [b"", b"short", None])
def test_a_file_that_is_no_key_is_refused(tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "own.key"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ExplainedError, match="key") as refused:
        mark_key.read_key(file)
    assert refused.value.remedy


def test_bits_and_their_digits() -> None:
    bits = mark_key.bits_of("80000000000000f1")
    assert bits[0] == 1
    assert bits.sum() == 6
    assert mark_key.id_of(np.asarray(bits)) == "80000000000000f1"
