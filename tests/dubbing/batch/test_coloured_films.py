"""Films in HDR and camera log through a batch: their key, their results, what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.errors import ExplainedError, ManifestError, MediaError
from dubbing.manifest.manifest import load
from dubbing.media import probe, read_frames
from dubbing.media.properties import film_values
from dubbing.media.properties.colour import DYNAMIC
from dubbing.report.sources import is_played
from tests import clips, fakes
from tests.dubbing.batches import dub

pytestmark = pytest.mark.medium

MANIFEST = """\
version: 1
output: out
identities:
  ann:
    clips: [{films}]
    {colour}
    seconds: 1
    consent: {{by: Ann, reference: form 17, films: [{films}]}}
dubs:
  - {{name: it, identity: ann, audio: it.wav, audio_seconds: 0.4, codec: {codec}, {keys}}}
"""
PQ = "setparams=color_trc=smpte2084:color_primaries=bt2020:colorspace=bt2020nc"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    fakes.install(monkeypatch.setattr)
    plain = clips.write_clip(tmp_path / "plain.mp4", 30)
    deep = ["-c:v", "prores_ks", "-profile:v", "4444", "-c:a", "pcm_s16le"]
    clips.ffmpeg("-i", plain, "-pix_fmt", "yuv444p10le", *deep, tmp_path / "log.mov")
    clips.ffmpeg("-i", plain, "-vf", f"format=yuv444p10le,{PQ}", *deep, tmp_path / "pq.mov")
    clips.write_sound(tmp_path / "it.wav", 0.4)
    return tmp_path


def manifest(
    folder: Path, films: str, colour: str = "", codec: str = "prores4444", keys: str = ""
) -> Path:
    path = folder / "m.yaml"
    colour = f"colour: {{{colour}}}" if colour else ""
    path.write_text(MANIFEST.format(films=films, colour=colour, codec=codec, keys=keys))
    return path


def test_a_log_film_is_dubbed_and_shown_as_a_display_shows_it(folder: Path) -> None:
    path = manifest(folder, "log.mov", "film: LogC4")
    assert dub(path)[0].code == 0
    out = folder / "out"
    report = json.loads((out / "report.json").read_text())["dubs"]["it"]
    shown = next(read_frames(folder / "log.mov"))
    for file in (report["video"], report["source"]):
        assert probe(out / file).frames >= 10
        picture = next(read_frames(out / file))
        assert picture[30:, :4].mean() > 1.2 * shown[30:, :4].mean()  # log is flat and dark here
    assert dub(path)[1] == []
    other = manifest(folder, "log.mov", "film: LogC3")
    assert "ann:prepare" in dub(other)[1]


def test_hdr_says_its_colour_space_itself(folder: Path) -> None:
    production = load(manifest(folder, "pq.mov"))
    assert any("pq.mov is Rec.2100-PQ - Display" in warning for warning in production.warnings)
    assert production.dubs["it"].film.info.values.film == "Rec.2100-PQ - Display"  # type: ignore
    assert probe(folder / "pq.mov").values.film
    assert not probe(folder / "log.mov").values.film


def test_a_browser_is_not_asked_to_show_hdr(folder: Path) -> None:
    for change, played in (("null", True), (PQ, False)):
        made = ["-vf", f"format=yuv420p10le,{change}", "-c:v", "libvpx-vp9", "-an"]
        clips.ffmpeg("-i", folder / "log.mov", *made, folder / "film.webm")
        assert is_played(folder / "film.webm") == played


def test_a_colour_space_may_be_that_of_some_clips(folder: Path) -> None:
    films = "plain.mp4, log.mov, pq.mov"
    path = manifest(folder, films, "film: LogC4, clips: [log.mov]", keys="clip: log.mov")
    production = load(path)
    spaces = {clip.path.name: clip.probed.values.film for clip in production.people["ann"].clips}
    found = {name.partition(";")[0]: space for name, space in spaces.items()}
    assert found == {
        **{"plain.mp4": "", "log.mov": "ARRI LogC4", "pq.mov": "Rec.2100-PQ - Display"}
    }
    assert production.dubs["it"].film.probed.values.film == "ARRI LogC4"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"codec": "h264"}, r"codec: h264 has 8 bits.*ARRI LogC4 of log.mov: choose hevc, prores"),
        ({"colour": "film: nope"}, r"has no such colour space.*choose of: .*V-Log"),
        ({"colour": "film: LogC4, clips: [plain.mp4]"}, r"plain.mp4 is no clip of ann"),
        ({"keys": "deliver: turnover"}, "log.mov is no image sequence"),
    ],
)
def test_what_is_refused(folder: Path, change: dict[str, str], words: str) -> None:
    path = manifest(folder, **{"films": "log.mov", "colour": "film: LogC4", **change})
    with pytest.raises(ManifestError, match=words):
        load(path)


def test_a_crop_of_it_is_a_picture_for_a_display(folder: Path) -> None:
    path = manifest(folder, "pq.mov", codec="h264", keys="frame: crop")
    assert dub(path)[0].code == 0
    assert probe(folder / "out" / "it.mp4").values.film == ""


def test_without_the_library_it_says_what_to_install(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film_values.spaces.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "PyOpenColorIO", None)
    for films, colour in (("pq.mov", ""), ("log.mov", "film: LogC4")):
        with pytest.raises(ExplainedError, match=r"not installed: PyOpenColorIO.*opencolorio"):
            load(manifest(folder, films, colour))
    assert load(manifest(folder, "log.mov")).dubs["it"].blocked is None


def test_dynamic_metadata_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.media.properties import colour

    read: Any = colour._side_data
    monkeypatch.setattr(
        colour, "_side_data", lambda frame: read(frame) | dict.fromkeys(DYNAMIC, b"")
    )
    (folder / "pq.mov").rename(folder / "other.mov")
    warnings = load(manifest(folder, "other.mov")).warnings
    named = "HDR10+, HDR Vivid, Dolby Vision, ambient light of other.mov"
    assert any(named in warning for warning in warnings)


def test_the_pictures_differ(folder: Path) -> None:
    """A display picture is tracked, not the flat one."""
    path = manifest(folder, "log.mov", "film: LogC4")
    clip = load(path).people["ann"].clips[0].path
    flat, shown = next(read_frames(folder / "log.mov")), next(read_frames(clip))
    assert np.abs(flat.astype(int) - shown).mean() > 20


@pytest.mark.parametrize("call", [(), ("--source",)])
def test_the_sync_of_camera_log_is_that_of_the_display_picture(
    folder: Path, monkeypatch: pytest.MonkeyPatch, call: tuple[str, ...]
) -> None:
    def seen(video: Path, **_: Any) -> None:
        raise MediaError(probe(video).values.film, "seen")

    monkeypatch.setattr("dubbing.sync.check.check", seen)
    film = str(folder / "log.mov")
    arguments = ["sync", film, *(one for option in call for one in (option, film))]
    for colour, space in (("LogC4", "ARRI LogC4"), ("nope", "no such colour space")):
        result = CliRunner().invoke(app, [*arguments, "--colour", colour])
        assert space in str(result.exception)
