"""`python -m dubbing.synthetic`: makes what manifests/demo.yaml names, once."""

import shutil
import sys
from pathlib import Path

import pytest

from dubbing.manifest import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.media import probe
from dubbing.synthetic import __main__ as program
from dubbing.synthetic.speaker import TAIL
from dubbing.synthetic.voice import speak
from tests import clips

MANIFEST = Path(__file__).resolve().parents[3] / "manifests" / "demo.yaml"


def test_makes_every_file_of_the_demo_and_makes_it_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(program, "SCRIPT", "Me.")
    monkeypatch.setattr(sys, "argv", ["speaker", str(tmp_path), "--size", "64"])
    assert program.main() == 0
    manifest = yaml_lines.read(MANIFEST.read_text()).data
    inputs = [person["clip"] for person in manifest["identities"].values()]
    inputs += [dub["audio"] for dub in manifest["dubs"]]
    assert len(inputs) == 3
    for name in inputs:
        assert Path(name).parent == Path("../out/demo/source")
        info = probe(tmp_path / Path(name).name)
        assert info.audio_duration is not None
        assert info.audio_duration < 6
    made = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert program.main() == 0
    assert made == {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}


@pytest.mark.parametrize("name", sorted(path.name for path in MANIFEST.parent.glob("*.yaml")))
def test_the_clip_is_as_long_as_the_manifests_want_it(tmp_path: Path, name: str) -> None:
    source = tmp_path / "out" / "demo" / "source"
    source.mkdir(parents=True)
    speak(program.SCRIPT, program.VOICE, tmp_path / "script.wav")
    seconds = probe(tmp_path / "script.wav").sound_seconds + TAIL
    clips.write_clip(source / "clip.mp4", round(25 * seconds))
    for recording, (voice, text) in program.DUBS.items():
        speak(text, voice, source / f"{recording}.wav")
    (tmp_path / "manifests").mkdir()
    for script in MANIFEST.parent.glob("*.srt"):
        shutil.copy(script, tmp_path / "manifests")
    copy = shutil.copy(MANIFEST.parent / name, tmp_path / "manifests")
    assert not load(Path(copy)).warnings


def test_many_identities(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["speaker", str(tmp_path), "--identities", "2", "--size", "64", "--seconds", "0.1"]
    monkeypatch.setattr(sys, "argv", arguments)
    assert program.main() == 0
    for folder in ("person000", "person001"):
        assert probe(tmp_path / folder / "clip.mp4").frames == 2


def test_a_mistake_is_an_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(program, "DUBS", {})
    monkeypatch.setattr(sys, "argv", ["speaker", str(tmp_path), "--size", "33"])
    assert program.main() == 1
    assert "even size" in capsys.readouterr().err
