"""A folder of shots with one script: who is in them, who is asked, and the manifest of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.errors import ExplainedError, ManifestError
from dubbing.face.mesh_points import RIGID
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.media import MediaInfo
from dubbing.preparation.tracking.following import Sighting
from dubbing.preparation.tracking.likeness import PARTS
from dubbing.reels import faces, reel_manifest
from tests import clips

pytestmark = pytest.mark.medium

SRT = """1
01:00:01,000 --> 01:00:02,000
ANN: One.

2
01:00:11,000 --> 01:00:12,000
BEN: Two.

3
01:00:20,500 --> 01:00:21,200
ANN: Three.

4
01:00:21,400 --> 01:00:22,800
BEN: Four.

5
01:00:40,000 --> 01:00:41,000
CAT: Is in a shot that is not here.
"""
WHO = {"s1": ("ann",), "s2": ("ben",), "s3": ("ben", "ann")}  # the larger face first


def looks_of(name: str, k: int) -> np.ndarray:
    """Looks of somebody, a little other every time."""
    noise = np.random.default_rng(k).normal(size=6 * len(PARTS))
    shape = np.random.default_rng(5).normal(size=3 * len(RIGID))
    return np.concatenate([shape, {"ann": 90, "ben": 160, "dot": 20}[name] + noise])


def seen(name: str, info: MediaInfo) -> Iterator[list[faces.Seen]]:
    """Stands in for `faces.frames_of`: everybody in a clip, in six of its frames."""
    for k in range(6):
        found = []
        for place, who in enumerate(WHO[name]):
            left = 20 * place + 10
            box = np.array([left, 10, left + 12 - place, 30 - place + k], float)
            image = np.full((faces.CELL, faces.CELL, 3), looks_of(who, k)[-1], np.uint8)
            x, y = box[0] / info.width, box[1] / info.height
            found.append(faces.Seen(name, k / 25, x, y, Sighting(k, box, looks_of(who, k)), image))
        yield found


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(faces, "frames_of", seen)
    for name, second in (("s1", "00"), ("s2", "10"), ("s3", "20")):
        made = clips.write_clip(tmp_path / f"{name}.mp4", 75)
        clips.ffmpeg(
            "-i", made, "-c", "copy", "-timecode", f"01:00:{second}:00", tmp_path / f"{name}.mov"
        )
        made.unlink()
    for number in range(1, 5):
        clips.write_sound(tmp_path / f"it_{number:02d}.wav", 0.6)
    (tmp_path / "reel.srt").write_text(SRT)
    return tmp_path


def written(folder: Path, *answers: str) -> tuple[Any, list[str]]:
    """The manifest as plain data, and what was said; nobody is asked without answers."""
    said: list[str] = []
    left = [*answers]

    def ask(question: str) -> str:
        said.append(question)
        return left.pop(0)

    path = reel_manifest.write_manifest(folder, said.append, ask if answers else None)
    assert path is not None
    assert not left
    return yaml_lines.read(path.read_text()).data, said


def agreed(folder: Path) -> Path:
    path = folder / "manifest.yaml"
    text = path.read_text().replace('by: "", reference: ""', 'by: "Ann", reference: "form 17"')
    path.write_text(text)
    return path


def test_lines_go_to_shots_and_speakers_to_faces(folder: Path) -> None:
    found, said = written(folder, "1", "2")
    assert {name: one["clips"] for name, one in found["identities"].items()} == {
        "ann": ["s1.mov", "s3.mov"],
        "ben": ["s2.mov", "s3.mov"],
    }
    assert all({*one["face"]} == {"at", "x", "y"} for one in found["identities"].values())
    assert [question for question in said if "?" in question] == [
        f"Which face is {who}? Numbers as 1 or 1, 3; nothing for nobody" for who in ("ANN", "BEN")
    ]
    # It is a manifest: every shot has its own lines, of the people in it.
    dubs = load(agreed(folder)).dubs
    spoken = {
        name: [(c.number, c.identity, c.audio.name) for c in d.cues] for name, d in dubs.items()
    }
    assert spoken == {
        "s1_reel": [(1, "ann", "it_01.wav")],
        "s2_reel": [(2, "ben", "it_02.wav")],
        "s3_reel": [(3, "ann", "it_03.wav"), (4, "ben", "it_04.wav")],
    }


def test_the_sheet_has_a_row_a_face(folder: Path) -> None:
    _, said = written(folder, "1", "2")
    sheet = np.asarray(Image.open(folder / reel_manifest.SHEET))
    cell = faces.CELL
    assert sheet.shape == (2 * cell, (faces.COLUMNS + 1) * cell, 3)
    assert said[:3] == [
        f"{folder / reel_manifest.SHEET} shows the faces of 3 clips",
        "face 1: s1.mov, s3.mov",
        "face 2: s2.mov, s3.mov",
    ]
    assert sheet[cell // 2, 3 * cell // 2].mean() == pytest.approx(90, abs=5)
    assert sheet[cell + cell // 2, 3 * cell // 2].mean() == pytest.approx(160, abs=5)


def test_where_nobody_is_asked_plan_names_what_is_missing(folder: Path) -> None:
    found, _ = written(folder)
    assert [*found["identities"]] == ["face-1", "face-2"]
    assert [one["speakers"] for one in found["dubs"]] == [
        *({"ANN": "?"}, {"BEN": "?"}, {"ANN": "?", "BEN": "?"})
    ]
    with pytest.raises(ManifestError) as caught:
        load(agreed(folder))
    problems = [str(problem) for problem in caught.value.problems]
    assert len(problems) == 4
    assert "dubs[2].speakers.BEN: no identity '?'; there is face-1, face-2" in problems[-1]


@pytest.mark.parametrize(
    ("answers", "speakers"),
    [
        (("9", "x", "1,", "1", "2"), {"ANN": "ann", "BEN": "ben"}),  # asked until it fits
        (("1", ""), {"ANN": "ann"}),
        (("1", "1"), {"ANN": "ann", "BEN": "ann"}),
    ],
)
def test_answers(folder: Path, answers: tuple[str, ...], speakers: dict[str, str]) -> None:
    found, said = written(folder, *answers)
    assert found["dubs"][-1]["speakers"] == speakers
    assert sum("Which face" in line for line in said) == len(answers)
    assert {*found["identities"]} == {*speakers.values()}


def test_two_faces_may_be_one_speaker(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on another day, in another room: each has an identity of its own."""
    monkeypatch.setitem(WHO, "s1", ("dot",))
    found, _ = written(folder, "3, 2", "1")  # ben is seen most by now
    people = [one["speakers"].get("ANN") for one in found["dubs"]]
    assert people == ["ann-2", None, "ann"]


def test_a_speaker_who_is_not_seen_in_a_shot_is_named_beside_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(WHO, "s3", ("ben",))
    written(folder, "2", "1")  # ben is seen most by now
    (line,) = (
        one for one in (folder / "manifest.yaml").read_text().splitlines() if "s3_reel" in one
    )
    assert 'speakers: {"BEN": "ben"}' in line
    assert line.endswith("# ANN: not seen in it")
    assert not line.lstrip().startswith("#")


def test_what_is_missing_is_a_comment(folder: Path) -> None:
    (folder / "it_02.wav").unlink()
    plain = folder / "s1.mov"
    clips.write_clip(folder / "s1.mp4", 75)
    plain.unlink()
    found, _ = written(folder, "1", "2")
    assert [one["name"] for one in found["dubs"]] == ["s3_reel"]
    text = (folder / "manifest.yaml").read_text()
    assert "# s1.mp4: it has no timecode in the script's times: fill in reel_start" in text
    assert "fill in audio, as long as the shot, or one for each line" in text


def test_a_recording_of_the_shot_serves_as_well(folder: Path) -> None:
    for path in folder.glob("it_*.wav"):
        path.unlink()
    clips.write_sound(folder / "s2_it.wav", 3)
    found, _ = written(folder, "1", "2")
    assert [one["audio"] for one in found["dubs"]] == ["s2_it.wav"]


def test_a_shot_that_cannot_be_read_is_named(folder: Path) -> None:
    (folder / "s4.mov").write_bytes(b"half of a copy")
    assert 'left out: "s4.mov": not a readable media file' in written(folder)[1]


def test_recordings_of_another_language_are_named(folder: Path) -> None:
    for number in range(1, 5):
        clips.write_sound(folder / f"fr_{number:02d}.wav", 0.6)
    _, said = written(folder)
    assert any("not used are it_01.wav, it_02.wav, it_03.wav, it_04.wav" in one for one in said)
    for number in range(1, 5):
        (folder / f"fr_{number:02d}.wav").unlink()
    (folder / "manifest.yaml").unlink()
    assert not any("not used" in one for one in written(folder)[1])


def test_other_folders_are_no_reels(folder: Path) -> None:
    (folder / "s1_it.srt").write_text(SRT)
    assert reel_manifest.write_manifest(folder, print) is None  # two scripts
    (folder / "reel.srt").unlink()
    assert reel_manifest.write_manifest(folder, print) is None  # that of one shot
    (folder / "s1_it.srt").unlink()
    (folder / "shots.csv").write_text("shot,lens\ns1,35\n")
    assert reel_manifest.write_manifest(folder, print) is None  # no script at all
    assert not (folder / reel_manifest.SHEET).exists()


def test_mistakes(folder: Path) -> None:
    (folder / "reel.srt").write_text("nothing")
    with pytest.raises(ExplainedError, match=r"reel\.srt"):
        reel_manifest.write_manifest(folder, print)
    (folder / "reel.srt").write_text(SRT.replace("01:00", "05:00"))
    with pytest.raises(ManifestError, match="no shot has lines of reel"):
        reel_manifest.write_manifest(folder, print)
    (folder / "reel.srt").write_text(SRT)
    (folder / "manifest.yaml").write_text("mine")
    with pytest.raises(ManifestError, match="there already"):
        reel_manifest.write_manifest(folder, print)
    assert (folder / "manifest.yaml").read_text() == "mine"


def test_the_command_asks_nobody_in_a_pipe(folder: Path) -> None:
    result = CliRunner().invoke(app, ["init", str(folder)])
    assert result.exit_code == 0, result.output
    assert "Which face" not in result.output
    assert "fill in who gave consent" in result.output


def test_one_frame_shows_nobody_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two people who look alike stay two."""
    twins = WHO | {"s1": ("ann", "ann")}
    monkeypatch.setattr("tests.dubbing.reels.test_reel_manifest.WHO", twins)
    monkeypatch.setattr(faces, "frames_of", seen)
    info: Any = type("Info", (), {"width": 64, "height": 48})()
    assert [len(face.seen) for face in faces.faces_of({"s1": info})] == [6, 6]
