"""The command `studio`, as far as it goes without serving anything."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from dubbing.cli import page_commands
from dubbing.cli.main import main
from tests.dubbing.studio.conftest import made, manifest

__all__ = ["made", "manifest"]
pytestmark = pytest.mark.medium


def ends(patch: pytest.MonkeyPatch, *words: object) -> int:
    patch.setattr("sys.argv", ["dfrf", "studio", *map(str, words)])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def test_where_others_can_reach_it_a_password_is_needed(
    manifest: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(page_commands.PASSWORD, raising=False)
    assert ends(monkeypatch, manifest, "--host", "0.0.0.0") == 2
    words = (
        "could open the page (--host 0.0.0.0): set DFRF_STUDIO_PASSWORD, or give --password-file"
    )
    assert words in capsys.readouterr().err.replace("\n", " ")
    short = manifest.with_name("password")
    short.write_text("1234567\n")
    assert ends(monkeypatch, manifest, "--host", "0.0.0.0", "--password-file", short) == 2
    assert "less than 8 characters" in capsys.readouterr().err


def test_a_port_that_is_taken_is_said(
    manifest: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert ends(monkeypatch, manifest, "--port", port) == 2
    assert "cannot listen there" in capsys.readouterr().err


def test_people_who_are_not_learned_are_said(
    manifest: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for record in (manifest.parent / "out" / "work").rglob("finetune/stage.json"):
        record.unlink()
    assert ends(monkeypatch, manifest) == 1
    assert "a person is not learned yet" in capsys.readouterr().err.replace("\n", " ")
