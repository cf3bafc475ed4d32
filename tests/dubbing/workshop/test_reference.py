"""The pages of docs/reference are what the schema and the commands give."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from dubbing.cli.main import COMMANDS
from dubbing.workshop import reference

PAGES = Path(__file__).parents[3] / "docs" / "reference"


@pytest.mark.parametrize("page", ["manifest.md", "commands.md"])
def test_a_page_is_current(page: str, tmp_path: Path) -> None:
    for name in ("manifest.md", "commands.md"):
        shutil.copy(PAGES / name, tmp_path)
    reference.write(tmp_path)
    written = (tmp_path / page).read_text(encoding="utf-8")
    assert written == (PAGES / page).read_text(encoding="utf-8"), "run `make docs`"


def test_every_command_and_every_entry_has_a_table() -> None:
    commands, keys = reference.command_tables(), reference.manifest_tables()
    for group, members in COMMANDS.items():
        assert f"## {group}\n" in commands
        for member in members:
            assert f"### `dfrf {member.__name__.replace('_', '-')}" in commands
    for heading in reference.ENTRIES.values():
        assert f"## {heading}\n" in keys


def test_a_key_is_described_by_its_values_and_its_default() -> None:
    keys = reference.manifest_tables()
    assert "| `size` | integer, 64 to 1024 in steps of 8 | `1024` |" in keys
    assert "| `consent` | path or [consent](#consent) | **required** |" in keys
    assert "| `label` | `true`, `false` or [label](#label) | `true` |" in keys
    assert "| `start` | seconds or time as `1:05.5` | `0` |" in keys
