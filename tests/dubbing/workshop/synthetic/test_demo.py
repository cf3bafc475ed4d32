"""`dfrf demo` and `python -m dubbing.workshop.synthetic`: what they make, they make once."""

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dubbing.batch import batch
from dubbing.cli.main import app
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.media import probe
from dubbing.workshop.synthetic import __main__ as program
from dubbing.workshop.synthetic import demo
from dubbing.workshop.synthetic.speaker import TAIL
from dubbing.workshop.synthetic.voice import speak
from tests import clips, fakes
from tests.dubbing.batches import dub

pytestmark = pytest.mark.medium


def write_stand_in(source: Path) -> None:
    """A clip as long as the synthetic speaker's, made in no time."""
    source.mkdir(parents=True)
    speak(demo.SCRIPT, demo.VOICE, source / "script.wav")
    seconds = probe(source / "script.wav").sound_seconds + TAIL
    clips.write_clip(source / "clip.mp4", round(25 * seconds))
    (source / "truth.npz").touch()


def test_the_demo_has_every_file_and_is_made_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "SCRIPT", "Me.")
    path = demo.write_demo(tmp_path, 64)
    manifest = yaml_lines.read(path.read_text()).data
    inputs = [person["clip"] for person in manifest["identities"].values()]
    inputs += [dub["audio"] for dub in manifest["dubs"]]
    assert len(inputs) == 3
    for name in inputs:
        info = probe(tmp_path / name)
        assert info.audio_duration is not None
        assert info.audio_duration < 6
    path.write_text(path.read_text().replace("400", "4"))  # a user's own change stays
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    assert demo.write_demo(tmp_path, 64) == path
    assert made == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}


def test_the_command_dubs_what_it_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_stand_in(tmp_path / "new" / "source")
    given = []

    def stand_in(manifest: object, *_: object, **__: object) -> batch.Result:
        given.append(manifest)
        return batch.Result({}, 0, tmp_path / "report.html", {})

    monkeypatch.setattr(batch, "dub", stand_in)
    call = CliRunner().invoke(app, ["demo", str(tmp_path / "new")])
    assert call.exit_code == 0, call.output
    (loaded,) = given
    assert loaded.manifest == (tmp_path / "new" / "demo.yaml").resolve()  # type: ignore[attr-defined]
    assert loaded.output == (tmp_path / "new").resolve()  # type: ignore[attr-defined]


# What these manifests are there to show.
MEANT = {
    "long_speech.yaml": "longer than the film",
    "scene.yaml": "nobody dubs 1 of 2 lines of scene.srt",
}


@pytest.mark.parametrize("name", sorted(path.name for path in demo.MANIFESTS.glob("*.yaml")))
def test_the_clip_is_as_long_as_the_manifests_want_it(tmp_path: Path, name: str) -> None:
    write_stand_in(tmp_path / "source")
    demo.write_demo(tmp_path)
    meant = MEANT.get(name, "nothing")
    assert not [warning for warning in load(tmp_path / name).warnings if meant not in warning]


def test_many_identities(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["speaker", str(tmp_path), "--identities", "2", "--size", "64", "--seconds", "0.1"]
    monkeypatch.setattr(sys, "argv", arguments)
    assert program.main() == 0
    for folder in ("person000", "person001"):
        assert probe(tmp_path / folder / "clip.mp4").frames == 2


def test_a_mistake_is_an_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["speaker", str(tmp_path), "--identities", "1", "--size", "33"]
    monkeypatch.setattr(sys, "argv", arguments)
    assert program.main() == 1
    assert "even size" in capsys.readouterr().err


def test_the_film_of_image_files_becomes_a_turnover(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fakes.install(monkeypatch.setattr)
    monkeypatch.setattr(demo, "FILM_SECONDS", 0.4)
    write_stand_in(tmp_path / "source")
    demo.write_demo(tmp_path)
    path = tmp_path / "film.yaml"
    path.write_text(path.read_text().replace("audio_seconds: 2.0", "audio_seconds: 0.4"))
    result, _ = dub(path)
    assert result.code == 0
    names = sorted(one.name for one in (tmp_path / "film" / "alba_film.turnover").iterdir())
    assert names == [*(f"alba.{k}.exr" for k in range(1001, 1011)), "over_the_film.nk"]
    report = json.loads((tmp_path / "film" / "report.json").read_text())["dubs"]["alba_film"]
    assert report["delivered"]["outside"] == 0
    assert report["delivered"]["steps"] <= 1
