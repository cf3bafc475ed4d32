"""JSON of ours is read back only in the shape that it was written in."""

import json
import os
from pathlib import Path

import pytest

from dubbing.engine.disk import json_records
from dubbing.errors import ExplainedError


def test_what_was_written_comes_back(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"a": [1, 2]}')
    assert json_records.read(tmp_path / "a.json", dict[str, list[int]], "curve") == {"a": [1, 2]}


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[1]",
        b'{"a": {"b": 1}}',
        b"{",
        b"\xff",
        b"[" * 100_000,
        b'{"a": 1' + b"1" * 6000 + b"}",
    ],
)
def test_another_shape_is_reported_in_one_sentence(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(ExplainedError, match=r"^curve holds something else: .*a\.json.*: do this$"):
        json_records.read(path, dict[str, int], "curve", "do this")


def test_what_is_no_file_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name in ("pipe", "zero"):
        with pytest.raises(ExplainedError, match="is no regular file"):
            json_records.read(tmp_path / name, dict[str, int], "curve")
    with pytest.raises(ExplainedError, match="curve cannot be read: No such file"):
        json_records.read(tmp_path / "none", dict[str, int], "curve")
    (tmp_path / "long").write_text(json.dumps(dict.fromkeys(map(str, range(99)), 1)))
    monkeypatch.setattr(json_records, "MOST_BYTES", 100)
    with pytest.raises(ExplainedError, match="is larger than"):
        json_records.read(tmp_path / "long", dict[str, int], "curve")
