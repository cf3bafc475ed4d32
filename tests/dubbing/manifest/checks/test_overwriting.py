"""A manifest whose results would take the place of what it reads is refused."""

import os
import shutil
from pathlib import Path

import pytest

from dubbing.engine.disk.files import LONGEST_NAME
from dubbing.errors import ManifestError
from dubbing.manifest.manifest import load
from dubbing.production.dub import previous_of
from tests import clips


@pytest.fixture
def folder(footage: Path, tmp_path: Path) -> Path:
    shutil.copyfile(footage / "ann.mp4", tmp_path / "host.mp4")
    shutil.copyfile(footage / "it.wav", tmp_path / "it.wav")
    (tmp_path / "out").mkdir()
    return tmp_path


def problems(
    folder: Path, output: str, clip: str = "host.mp4", audio: str = "it.wav", name: str = "m.yaml"
) -> list[str]:
    (folder / name).write_text(
        f"version: 1\noutput: {output}\nidentities:\n"
        f"  ann: {{clip: {clip}, seconds: 1, consent: {clips.CONSENT}}}\n"
        f"dubs: [{{name: host, identity: ann, audio: {audio}}}]\n"
    )
    try:
        load(folder / name)
    except ManifestError as error:
        return [str(problem) for problem in error.problems]
    return []


def test_a_folder_where_a_result_should_go(folder: Path) -> None:
    (folder / "out" / "host.mp4").mkdir()
    (folder / "out" / "report.html").mkdir()
    (folder / "out" / "work").write_text("a file")
    message = problems(folder, "out")
    assert [line.split(": ")[1] for line in message] == ["output", "output", "dubs[0]"]
    assert "host.mp4 is a folder, where a file should go: move it away" in message[2]
    assert any("work is a file, not a folder" in line for line in message)


def test_a_dub_of_its_own_clip(folder: Path) -> None:
    assert problems(folder, "out") == []
    (message,) = problems(folder, ".")
    assert message.startswith("line 5: dubs[0]: ")
    assert "host.mp4 would take the place of identities.ann.clip" in message
    assert message.endswith("choose another output or name")


@pytest.mark.parametrize("link", [os.link, os.symlink])
def test_the_clip_by_another_name(folder: Path, link: object) -> None:
    assert callable(link)
    link(folder / "host.mp4", folder / "out" / "host.mp4")
    (message,) = problems(folder, "out")
    assert "would take the place of identities.ann.clip" in message


@pytest.mark.parametrize("name", ["host.sync.json", "report.html", "report.json", "evaluate.json"])
def test_what_lies_beside_the_video(folder: Path, name: str) -> None:
    (folder / "it.wav").rename(folder / name)
    (folder / "host.mp4").rename(folder / "clip.mp4")
    (message,) = problems(folder, ".", clip="clip.mp4", audio=name)
    assert "would take the place of dubs[0].audio" in message


def test_the_manifest_itself(folder: Path) -> None:
    (folder / "host.mp4").rename(folder / "clip.mp4")
    (message,) = problems(folder, ".", clip="clip.mp4", name="report.json")
    assert "would take the place of this manifest" in message


def test_inputs_where_the_stages_work(folder: Path) -> None:
    (folder / "out" / "work").mkdir()
    (folder / "it.wav").rename(folder / "out" / "work" / "it.wav")
    (message,) = problems(folder, "out", audio="out/work/it.wav")
    assert message.startswith("line 5: dubs[0].audio: ")
    assert "lies where the stages work" in message


def test_links_to_themselves_in_the_output_are_no_inputs(folder: Path) -> None:
    for name in ("report.html", "work"):
        (folder / "out" / name).symlink_to(folder / "out" / name)
    assert problems(folder, "out") == []


@pytest.mark.parametrize(
    ("first", "second", "clash"),
    [
        ("a, codec: prores", "a.proxy", "a.proxy.mp4"),
        ("a.proxy", "a, codec: prores", "a.proxy.mp4"),
        ("a", "a.previous", "a.previous.mp4"),
        ("caf\u00e9, codec: prores", "cafe\u0301.Proxy", "cafe\u0301.Proxy.mp4"),
    ],
)
def test_results_that_would_be_one_file(folder: Path, first: str, second: str, clash: str) -> None:
    (folder / "m.yaml").write_text(
        f"version: 1\noutput: out\nidentities:\n"
        f"  ann: {{clip: host.mp4, seconds: 1, consent: {clips.CONSENT}}}\n"
        f"dubs:\n  - {{identity: ann, audio: it.wav, name: {first}}}\n"
        f"  - {{identity: ann, audio: it.wav, name: {second}}}\n"
    )
    with pytest.raises(ManifestError) as caught:
        load(folder / "m.yaml")
    (problem,) = caught.value.problems
    assert problem.key == "dubs[1]"
    assert problem.message.startswith(f"{clash} would be of dubs ")
    assert problem.message.endswith("rename one")


@pytest.mark.parametrize("names", [("Ann", "ann"), ("caf\u00e9", "cafe\u0301")])
def test_names_that_would_share_a_folder(folder: Path, names: tuple[str, str]) -> None:
    one, other = names
    person = f"{{clip: host.mp4, seconds: 1, consent: {clips.CONSENT}}}"
    (folder / "m.yaml").write_text(
        f"version: 1\noutput: out\nidentities:\n  {one}: {person}\n  {other}: {person}\n"
        f"dubs: [{{name: {one}, identity: {one}, audio: it.wav}},\n"
        f"  {{name: {other}, identity: {one}, audio: it.wav}}]\n"
    )
    with pytest.raises(ManifestError) as caught:
        load(folder / "m.yaml")
    assert [problem.key for problem in caught.value.problems] == [
        f"identities.{other}",
        "dubs[1].name",
    ]
    assert all("is taken by" in problem.message for problem in caught.value.problems)


def test_a_long_name_leaves_room_for_the_last_result() -> None:
    dub = "\u00e9" * 115
    name = previous_of(dub, f"{dub}.lines.jsonl")
    assert len(name.encode()) <= LONGEST_NAME
    assert name.startswith("\u00e9" * 100)
    assert name.endswith("\u00e9.previous.lines.jsonl")
