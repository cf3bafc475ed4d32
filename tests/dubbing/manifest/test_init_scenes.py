"""Scripts that lie beside clips and recordings become scenes of a first manifest."""

from pathlib import Path

import pytest

from dubbing.manifest import init
from dubbing.manifest.keys import yaml_lines
from tests import clips

pytestmark = pytest.mark.medium


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    clips.write_clip(tmp_path / "host.mp4", 75)
    clips.write_sound(tmp_path / "host_it.wav", 2)
    return tmp_path


def script(folder: Path, name: str, *speakers: str) -> None:
    """A script with one line a speaker, half a second each."""
    cues = (
        f"{k}\n00:00:0{k},000 --> 00:00:0{k},500\n{who + ': ' if who else ''}ciao\n"
        for k, who in enumerate(speakers)
    )
    (folder / name).write_text("\n".join(cues))


def written(folder: Path) -> tuple[object, str]:
    text = init.write_manifest(folder).read_text()
    return yaml_lines.read(text).data["dubs"], text


@pytest.mark.parametrize(
    ("speakers", "keys"),
    [
        (("",), {"identity": "host"}),
        (("ANNA", "ANNA"), {"speakers": {"ANNA": "host"}}),
        (("GUEST", "HOST"), {"speakers": {"HOST": "host"}}),
    ],
)
def test_a_script_and_its_recording_are_one_scene(
    folder: Path, speakers: tuple[str, ...], keys: dict[str, object]
) -> None:
    script(folder, "host_it.srt", *speakers)
    dubs, _ = written(folder)
    scene = {"name": "host_it", "lines": "host_it.srt", "audio": "host_it.wav", **keys}
    assert dubs == [scene]


def test_a_recording_of_the_speaker_serves_as_well(folder: Path) -> None:
    (folder / "host_it.wav").rename(folder / "host_it_HOST.wav")
    script(folder, "host_it.srt", "HOST", "GUEST")
    dubs, _ = written(folder)
    assert dubs == [
        {
            "name": "host_it",
            "lines": "host_it.srt",
            "speakers": {"HOST": "host"},
            "audio": "host_it_HOST.wav",
        }
    ]


def test_a_cameras_xml_and_a_table_of_shots_are_no_scripts(tmp_path: Path) -> None:
    """Beside a clip, a recording and a script that are alone, whatever they are called."""
    clips.write_clip(tmp_path / "C0001.mp4", 30)
    clips.write_sound(tmp_path / "voice.wav", 1)
    script(tmp_path, "words.srt", "")
    (tmp_path / "C0001M01.XML").write_text("<NonRealTimeMeta><Duration/></NonRealTimeMeta>")
    (tmp_path / "shots.csv").write_text("shot,lens\nC0001,35\n")
    (tmp_path / "half.csv").write_text("in,out,speaker,words\n1,soon,,x\n")
    _, text = written(tmp_path)
    assert '# left out: "C0001M01.XML": it is no timed text' in text
    assert '# left out: "shots.csv": its first row names no column in' in text
    assert '  # - {name: "half", lines: "half.csv"}' in text
    for name in ("half.csv", "manifest.yaml"):
        (tmp_path / name).unlink()
    scene = {"name": "words", "lines": "words.srt", "identity": "C0001", "audio": "voice.wav"}
    assert written(tmp_path)[0] == [scene]


@pytest.mark.parametrize(
    ("name", "speakers", "why"),
    [
        ("other.srt", ("HOST",), "fits no clip"),
        ("host_it.srt", ("ANNA", "BERT"), 'there are "ANNA", "BERT"'),
        ("host_de.srt", ("HOST",), 'no recording is called "host_de"'),
        ("host_it.srt", (), "holds no line"),
    ],
)
def test_what_is_missing_is_written_beside_the_scene(
    folder: Path, name: str, speakers: tuple[str, ...], why: str
) -> None:
    script(folder, name, *speakers)
    dubs, text = written(folder)
    assert dubs == [{"name": "host_it", "identity": "host", "audio": "host_it.wav"}]
    (line,) = (line for line in text.splitlines() if f'lines: "{name}"' in line)
    assert line.startswith("  # - {")
    assert why in line
