"""Pairs are blind, balanced, and the same again; the key alone says which was which."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.errors import CallError, ExplainedError
from dubbing.manifest.manifest import load
from dubbing.rating.pairs import KEY, PAGE, Pair, read, write
from tests.dubbing.rating import versions

Two = tuple[Path, Path]


def made(two: Two, folder: Path) -> list[Pair]:
    return write([load(path) for path in two], folder)[0]["pairs"]


def test_the_key_says_which_was_which(two: Two, tmp_path: Path) -> None:
    pairs = made(two, tmp_path)
    assert sorted(pair["dub"] for pair in pairs) == sorted(versions.DUBS)
    assert read(tmp_path)["pairs"] == pairs
    for pair in pairs:
        sides = (pair["first"], pair["second"])
        assert {side["version"] for side in sides} == {0, 1}
        for side in sides:
            source = two[side["version"]].parent / "out" / f"{pair['dub']}.mp4"
            assert (tmp_path / side["video"]).read_bytes() == source.read_bytes()
            assert (side["closeness"], side["parts"]) == (0.9, versions.PARTS)


def test_each_version_is_first_in_half_of_the_pairs_drawn_by_content(
    two: Two, tmp_path: Path
) -> None:
    pairs = made(two, tmp_path / "a")
    assert sum(pair["first"]["version"] for pair in pairs) == len(pairs) / 2
    assert [pair["dub"] for pair in pairs] != list(versions.DUBS)
    moved = tmp_path / "moved"  # other places and dates, the same content
    shutil.copytree(two[0].parent.parent, moved)
    again = made((moved / "old" / "m.yaml", moved / "secret" / "m.yaml"), tmp_path / "b")
    assert again == pairs


def test_nothing_on_the_page_tells_a_version(two: Two, tmp_path: Path) -> None:
    pairs = made(two, tmp_path)
    page = (tmp_path / PAGE).read_text()
    for pair in pairs:
        assert pair["id"] in page
        assert pair["first"]["video"] in page
        assert re.fullmatch(r"[0-9a-f]{12}\.mp4", pair["first"]["video"])
    data = page.split('id="data">')[1].split("</script>")[0]
    for word in ("old", "secret", "m.yaml", "0.9", "closeness", "version", "parts", *versions.DUBS):
        assert not re.search(rf'(?<![0-9a-f]){re.escape(word)}(?![0-9a-f"])', data), word
        assert f'"{word}"' not in data, word
    assert {path.name for path in tmp_path.iterdir()} == {
        *(PAGE, KEY),
        *(pair[side]["video"] for pair in pairs for side in ("first", "second")),
    }


def test_what_one_folder_lacks_is_named(two: Two, tmp_path: Path) -> None:
    other = versions.write(tmp_path / "other", ("it", "de", "nl"), first_frames=60)
    (other.parent / "out" / "de.mp4").unlink()
    shutil.copy(two[0].parent / "out" / "it.mp4", other.parent / "out")
    with pytest.raises(ExplainedError, match=r"no dub of one name.*it: the same video.*dfrf dub"):
        write([load(two[0]), load(other)], tmp_path / "none")
    key, left_out = write([load(path) for path in (*two, other)], tmp_path / "rate")
    assert [line.split(": ")[0] for line in left_out] == ["it", "de", "fr", "es", "nl", "nl"]
    assert f"de: not made by {other}" in left_out
    assert f"nl: no dub of {two[0]}" in left_out
    # The last version's `it` is that of the first: beside the second alone.
    assert sum(2 in (p["first"]["version"], p["second"]["version"]) for p in key["pairs"]) == 1


def test_a_key_that_answers_need_is_kept(two: Two, tmp_path: Path) -> None:
    other = versions.write(tmp_path / "other", first_frames=60)
    made(two, tmp_path / "rate")
    before = (tmp_path / "rate" / KEY).read_text()
    made(two, tmp_path / "rate")
    with pytest.raises(CallError, match="pairs of other videos"):
        made((two[0], other), tmp_path / "rate")
    assert (tmp_path / "rate" / KEY).read_text() == before
    with pytest.raises(CallError, match="same output"):
        made((two[0], two[0]), tmp_path / "same")


def test_a_damaged_check_is_named(tmp_path: Path) -> None:
    two = [versions.write(tmp_path / name, ("it",), k) for k, name in enumerate("ab", 20)]
    (tmp_path / "a" / "out" / "it.sync.json").write_text('{"parts": 3}')
    with pytest.raises(ExplainedError, match=r"sync check holds something else: parts.*it.sync"):
        made((two[0], two[1]), tmp_path / "rate")


def test_the_command_makes_a_page(two: Two, tmp_path: Path) -> None:
    call = ["rate", *map(str, two), "--output", str(tmp_path / "rate")]
    found = CliRunner().invoke(app, call)
    assert (found.exit_code, (tmp_path / "rate" / PAGE).is_file()) == (0, True)
    assert "4 pairs" in found.output
    for wrong in ([str(two[0]), "-o", str(tmp_path)], [str(two[0])], [str(tmp_path)]):
        assert isinstance(CliRunner().invoke(app, ["rate", *wrong]).exception, CallError)
