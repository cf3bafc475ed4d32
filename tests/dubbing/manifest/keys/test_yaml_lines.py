"""What YAML may hold: safe, small, each key once, each with its line."""

from __future__ import annotations

import datetime
import os
import re
from pathlib import Path

import pytest

from dubbing.errors import ManifestError
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from tests.dubbing.manifest.made import GOOD, problems, read

pytestmark = pytest.mark.medium


@pytest.mark.parametrize(
    ("written", "reported"),
    [
        ("a: [", "not valid YAML"),
        ("version: !!python/object/apply:os.system [ls]", "not valid YAML"),
        ("a: &a [*a, *a]", "not valid YAML"),
        ("", "must hold version, output, identities and dubs"),
        ("- 1", "must hold version, output, identities and dubs"),
        ("version: 1\nversion: 1", "version: given twice"),
        ("version: 1\n1: x", "the key '1' is not text"),
        ("version: true\noutput: out\nidentities: {}", "version: must be 1"),
        ("version: 1\noutput: out\nidentities: {}", "identities: names nobody"),
        ("version: 1\noutput: out", "identities: is required"),
        ("version: 1\noutput: out\nidentities: [a]", "identities: must be a mapping"),
        ("version: 1\noutput: host.mp4", "is a file, not a folder"),
        ("version: 1\noutput: host.mp4/out", "line 2: output: .*host.mp4 is a file, not a folder"),
        (
            "version: 1\noutput: ~no_such_user/x",
            "line 2: output: cannot be a path: Could not determine",
        ),
        ('version: 1\noutput: "a\\0b"', "line 2: output: cannot be a path: embedded null"),
        (f"version: 1\noutput: {'x' * 300}", "line 2: output: cannot be a path: File name too"),
        ("version: 1\nb: \x07", "line 2: not valid YAML: the character '.x07' is not allowed"),
        ("version: 1\na: " + "[" * 3000, "line 2: not valid YAML: too many brackets"),
        ('version: 1\na: {b: !!int "c"}', "line 2: not valid YAML: a.b 'c' cannot be read as int"),
        ("version: 1\na: !!bool x", "line 2: not valid YAML: a 'x' cannot be read as bool"),
    ],
)
def test_what_is_no_manifest(folder: Path, written: str, reported: str) -> None:
    assert any(re.search(reported, problem) for problem in problems(folder, written))


def test_aliases_cannot_explode(folder: Path) -> None:
    text = "a: &a0 [x, x]\n"
    text += "".join(f"b{k}: &a{k + 1} [*a{k}, *a{k}, *a{k}, *a{k}]\n" for k in range(20))
    assert any("too many" in problem for problem in problems(folder, text))


@pytest.mark.parametrize("bottom", ["{x: 1}", "{}"])
def test_merge_keys_cannot_explode(folder: Path, bottom: str) -> None:
    text = f"a0: &a0 {bottom}\n"
    text += "".join(
        f"a{k + 1}: &a{k + 1} {{<<: [{', '.join([f'*a{k}'] * 10)}]}}\n" for k in range(9)
    )
    assert len(text) < 1000
    # It would not end, were it built: a billion maps.
    assert any("too many or too deep aliases" in problem for problem in problems(folder, text))


@pytest.mark.parametrize("text", ["a: &a {<<: *a}\n", "a: &a {<<: [*a, *a]}\n"])
def test_what_merges_itself_is_refused(folder: Path, text: str) -> None:
    assert any("too many or too deep aliases" in problem for problem in problems(folder, text))


def test_keys_that_are_trees_cannot_explode(folder: Path) -> None:
    text = "a0: &a0 [x, x]\n"
    text += "".join(f"a{k + 1}: &a{k + 1} [*a{k}, *a{k}]\n" for k in range(30))
    assert any("too many" in problem for problem in problems(folder, text + "? *a30\n: x\n"))
    assert "line 1: a key is not text" in problems(folder, "? [x, y]\n: x\n")


def test_a_mapping_that_merges_can_be_used_twice(folder: Path) -> None:
    text = GOOD + "  - &a {identity: host, audio: it.wav, name: a}\n  - &b {<<: *a, name: b}\n"
    manifest = read(folder, text + "  - {<<: [{name: c, label: false}, *b]}\n")
    assert [(dub.name, dub.settings.label) for dub in manifest.dubs.values()][1:] == [
        ("a", True),
        ("b", True),
        ("c", False),
    ]
    text = "a: &a {x: 1}\nb: &b {<<: *a, x: 2}\nc: *b\n"
    assert yaml_lines.read(text).data == {"a": {"x": 1}, "b": {"x": 2}, "c": {"x": 2}}
    assert yaml_lines.read(text).problems == []


def test_words_and_clock_times_are_text() -> None:
    text = "a: no\nb: 1:05\nc: 010\nd: true\ne: 0o10\nf: 2026-11-02\n"
    date = datetime.date(2026, 11, 2)
    expected = {"a": "no", "b": "1:05", "c": 10, "d": True, "e": 8, "f": date}
    assert yaml_lines.read(text).data == expected


@pytest.mark.parametrize("text", ["[" * 100_000, "".join(" " * k + "a:\n" for k in range(60))])
def test_brackets_in_one_another_are_counted_while_they_are_read(text: str) -> None:
    (problem,) = yaml_lines.read(text).problems
    assert problem.message == "not valid YAML: too many brackets in one another"


def test_a_manifest_of_too_many_values_is_not_built(folder: Path) -> None:
    assert any("too many values" in p for p in problems(folder, f"a: [{'x, ' * 150_000}]"))


@pytest.mark.parametrize(
    ("keys", "reported"),
    [
        (f"seed: {'1' * 6000}", "line 4: not valid YAML: identities.host.seed '111"),
        (f"seed: 0x{'1' * 6000}", "line 4: not valid YAML: identities.host.seed '0x111"),
        (
            f"seed: 1{':59' * 6000}",
            "line 4: identities.host.seed: must be a valid integer, not '1:59",
        ),
        ("seed: 0x" + "1" * 90, "line 4: identities.host.seed: must be less than"),
        ("start: 1.0e+308", "line 4: identities.host.start: must be less than"),
        ("size: [" + "x, " * 5000 + "]", "line 4: identities.host.size: must be"),
        ('base: "\\udcff"', "line 4: not valid YAML: identities.host.base"),
    ],
)
def test_numbers_without_end(folder: Path, keys: str, reported: str) -> None:
    text = GOOD.replace("seconds: 2,", f"seconds: 2, {keys},")
    found = problems(folder, text)[0]
    assert found.startswith(reported)
    assert len(found) < 200


def test_what_is_no_regular_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (Path("/dev/zero"), tmp_path / "pipe.yaml"):
        with pytest.raises(ManifestError, match="is no regular file"):
            load(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "it is a folder: name a file"),
        ("by: \u00c4nn".encode("latin-1"), "it is not UTF-8: save it as UTF-8"),
        (b"\0\0\0\x18ftypmp42\xff", "a manifest is a YAML file"),
    ],
)
def test_what_is_no_text_is_no_manifest(
    tmp_path: Path, content: bytes | None, message: str
) -> None:
    path = tmp_path / "film"
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content)
    with pytest.raises(ManifestError, match=message):
        load(path)


def test_a_manifest_of_many_megabytes_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "m.yaml").open("wb") as stream:
        stream.truncate(11 * 10**6)
    with pytest.raises(ManifestError, match="is larger than 10 MB"):
        load(tmp_path / "m.yaml")


def test_a_folder_whose_name_is_no_utf8_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    (folder / "m.yaml").write_text(GOOD)
    with pytest.raises(ManifestError, match="its name is no UTF-8: rename"):
        load(folder / "m.yaml")
