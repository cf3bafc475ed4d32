"""What `dfrf init` writes: one dub a recording, and comments for what fits nothing."""

from dataclasses import replace
from pathlib import Path

import pytest

from dubbing.errors import ManifestError
from dubbing.manifest import init
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.media import MediaInfo, probe
from tests import clips


@pytest.mark.parametrize(
    ("recording", "clip"),
    [
        ("shot1_it", "shot1"),
        ("shot10_it", "shot10"),
        ("shot1", "shot1"),
        ("SHOT1-it", "shot1"),
        ("shot1 take 2", "shot1"),
        ("shot1_b_it", "shot1_b"),
        ("shot1_bit", "shot1"),
        ("shot100_it", None),
        ("shot_it", None),
        ("shot1it", None),
        ("it_shot1", None),
        ("Ame\u0301lie_it", "Am\u00e9lie"),
    ],
)
def test_a_recording_belongs_to_the_clip_whose_name_begins_its_own(
    recording: str, clip: str | None
) -> None:
    names = ["shot1", "shot10", "shot1_b", "Am\u00e9lie"]
    assert init.clip_of(recording, names) == clip
    assert init.clip_of(recording, names[::-1]) == clip


def test_forty_clips_and_two_hundred_recordings_give_two_hundred_dubs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = probe(clips.write_clip(tmp_path / "clip.mp4", 30))
    sound = probe(clips.write_sound(tmp_path / "sound.wav", 1))
    for path in (clip.path, sound.path):
        path.unlink()

    def as_named(path: Path) -> MediaInfo:
        return replace(clip if path.suffix == ".mp4" else sound, path=path)

    monkeypatch.setattr(init, "probe", as_named)
    for k in range(1, 41):
        (tmp_path / f"shot{k}.mp4").touch()
        for language in ("it", "de", "fr", "es", "pt"):
            (tmp_path / f"shot{k}_{language}.wav").touch()
    written = yaml_lines.read(init.write_manifest(tmp_path).read_text()).data
    assert len(written["identities"]) == 40
    assert len(written["dubs"]) == 200
    assert all(dub["audio"].startswith(f"{dub['identity']}_") for dub in written["dubs"])
    assert all(dub["audio"] == f"{dub['name']}.wav" for dub in written["dubs"])


def test_one_clip_and_one_recording_are_a_pair(tmp_path: Path) -> None:
    clips.write_clip(tmp_path / "shot1.mp4", 30)
    clips.write_sound(tmp_path / "voice.wav", 1)
    said: list[str] = []
    text = init.write_manifest(tmp_path, said.append).read_text()
    assert yaml_lines.read(text).data["dubs"] == [{"identity": "shot1", "audio": "voice.wav"}]
    why = "there is no other clip, and no other recording"
    assert said == [f"voice.wav is for shot1.mp4: {why}"]
    assert f"# {why}" in text
    (tmp_path / "manifest.yaml").unlink()
    (tmp_path / "words.srt").write_text("1\n00:00:00,000 --> 00:00:01,000\nciao\n")
    dubs = yaml_lines.read(init.write_manifest(tmp_path, said.append).read_text()).data["dubs"]
    scene = {"name": "words", "lines": "words.srt", "identity": "shot1", "audio": "voice.wav"}
    assert dubs == [scene]
    for other in ("music.wav", "shot2.mp4"):  # it may belong to this one, or be something else
        (tmp_path / "manifest.yaml").unlink()
        write = clips.write_sound if other.endswith("wav") else clips.write_clip
        write(tmp_path / other, 30)
        said.clear()
        text = init.write_manifest(tmp_path, said.append).read_text()
        assert not yaml_lines.read(text).data["dubs"]
        assert "voice.wav is for nobody: its name begins with no clip's" in said
        (tmp_path / other).unlink()


def test_a_folder_without_recordings_is_said_to_have_none(tmp_path: Path) -> None:
    clips.write_clip(tmp_path / "shot1.mp4", 30)
    said: list[str] = []
    init.write_manifest(tmp_path, said.append)
    assert said == ["no recording was found, so there is nothing to dub yet"]


def test_what_fits_nothing_is_written_as_comments(tmp_path: Path) -> None:
    clips.write_clip(tmp_path / "shot1.mp4", 30)
    (tmp_path / "Shot1.mov").write_bytes((tmp_path / "shot1.mp4").read_bytes())
    clips.write_video(tmp_path / "mute.mp4", 30)
    clips.write_sound(tmp_path / "shot10_it.wav", 1)
    (tmp_path / "half.mp4").write_bytes((tmp_path / "shot1.mp4").read_bytes()[:9000])
    (tmp_path / "notes.txt").write_text("no media")
    for hidden in ("._shot1.mp4", "._shot1.srt"):  # as macOS leaves them
        (tmp_path / hidden).write_bytes(b"\0\x05\x16\x07")
    said: list[str] = []
    text = init.write_manifest(tmp_path, said.append).read_text()
    written = yaml_lines.read(text).data
    assert list(written["identities"]) == ["Shot1"]
    assert written["dubs"] is None
    assert '  # - {identity: "Shot1", audio: "shot10_it.wav"}' in text
    assert '  # left out: "mute.mp4" has no sound to learn from' in text
    assert '  # left out: "shot1.mp4" has the name of "Shot1.mov"' in text
    assert "._" not in text
    left_out = [one for one in said if one.startswith("left out")]
    assert [one.split('"')[1] for one in left_out] == ["half.mp4", "mute.mp4", "shot1.mp4"]
    assert left_out[0].startswith('left out: "half.mp4": it breaks off: ')
    uncommented = yaml_lines.read(text.replace("  # - {", "  - {")).data
    assert uncommented["dubs"] == [{"identity": "Shot1", "audio": "shot10_it.wav"}]


def test_two_recordings_of_one_name_are_two_dubs(tmp_path: Path) -> None:
    clips.write_clip(tmp_path / "shot1.mp4", 30)
    for name in ("shot1_it.wav", "shot1_it.flac", "shot1_de.wav"):
        clips.write_sound(tmp_path / name, 1)
    written = yaml_lines.read(init.write_manifest(tmp_path).read_text()).data
    named = ["shot1_de", "shot1_it.flac", "shot1_it.wav"]
    assert [dub["name"] for dub in written["dubs"]] == named


def test_what_is_written_of_films_with_any_name_is_a_manifest(tmp_path: Path) -> None:
    long = "A title as of a download, which goes on and on until nobody reads it to its end " * 2
    for stem in ("Screencast 10:47", "tab\t", long):
        clips.write_clip(tmp_path / f"{stem}.mp4", 30)
        clips.write_sound(tmp_path / f"{stem}_it.wav", 1)
    path = init.write_manifest(tmp_path)
    path.write_text(path.read_text().replace('""', '"Ann Smith"'))
    names = [*load(path).dubs]
    assert len(names) == 3
    assert "Screencast 10-47_it" in names


def test_a_folder_whose_only_clip_cannot_be_read_says_why(tmp_path: Path) -> None:
    (tmp_path / "shot1.mp4").write_bytes(b"half of a copy")
    with pytest.raises(ManifestError, match=r'no clip with sound .*"shot1\.mp4": not a readable'):
        init.write_manifest(tmp_path)
