from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from dubbing.cli import main as cli
from tests import clips


@pytest.fixture
def manifest(footage: Path, tmp_path: Path) -> Path:
    path = tmp_path / "m.yaml"
    path.write_text(
        f"""
version: 1
output: out
identities: {{ann: {{clip: {footage}/ann.mp4, seconds: 1, consent: {clips.CONSENT}}}}}
dubs: [{{name: it, identity: ann, audio: {footage}/it.wav}}]
"""
    )
    return path


@pytest.fixture
def dfrf(
    stand_ins: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> object:
    """Run the command line with stand-ins; gives exit code, output and errors."""
    before = signal.getsignal(signal.SIGTERM)

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dfrf", *map(str, arguments)])
        try:
            cli.main()
            code: object = 0
        except SystemExit as end:
            code = end.code or 0
        finally:
            signal.signal(signal.SIGTERM, before)
        assert isinstance(code, int)
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run
