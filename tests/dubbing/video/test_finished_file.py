"""The file of a finished video: codecs, rates, segments, sound, and its last check."""

from __future__ import annotations

import json
import subprocess
import sys
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from dubbing import media
from dubbing.engine.environment import of_children
from dubbing.errors import RenderingError
from dubbing.mixing.sound import Sound
from dubbing.preparation.prepared import PreparedClip
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue, frame_count
from dubbing.video import assembly, composer
from dubbing.video.assembly import make
from dubbing.video.files import PICTURE_FILE
from dubbing.video.heads import Heads, read_heads
from dubbing.video.settings import VideoSettings
from dubbing.video.verification import verify
from tests import clips, fakes
from tests.dubbing.video.scene import Scene, kept_of, quiet, recording

pytestmark = pytest.mark.medium


@pytest.mark.parametrize(
    ("codec", "rate"),
    [
        ("h264", Fraction(24000, 1001)),
        ("h264", Fraction(25)),
        ("h264", Fraction(30)),
        ("prores", Fraction(24000, 1001)),
        ("ffv1", Fraction(30000, 1001)),
    ],
)
def test_codecs_and_rates(
    tmp_path: Path, rate: Fraction, codec: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assembly, "SEGMENT", 10)
    scene = Scene(tmp_path, 28, rate)
    seconds = 0.9
    frames = frame_count(seconds, rate)
    out = scene.make(np.arange(frames), codec=codec, seconds=seconds, audio_rate=None)
    info = media.probe(out)
    assert out.suffix == media.SUFFIX[codec]
    assert media.count_frames(out) == frames
    assert info.rate == rate
    assert abs(info.video_start - info.audio_start) < 1e-3
    assert (info.audio_rate, info.audio_channels) == (44100, 2)
    assert info.audio_duration == pytest.approx(seconds, abs=0.03)
    assert [clips.number(f) for f in media.read_frames(out)] == list(range(frames))
    with av.open(str(out)) as container:
        tags = {key.lower(): value for key, value in container.metadata.items()}
    assert "AI-generated" in tags["comment"]
    proxy = {"proxy.mp4"} - ({"proxy.mp4"} if codec == "h264" else set())  # browsers play H.264
    assert {p.name for p in out.parent.iterdir()} == {out.name, "picture.json", "made_of"} | proxy


@pytest.mark.parametrize("codec", ["h264", "hevc", "prores", "ffv1"])
@pytest.mark.parametrize("rate", [Fraction(25), Fraction(24000, 1001)])
def test_what_did_not_change_is_taken_from_the_last_result(
    tmp_path: Path, rate: Fraction, codec: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assembly, "SEGMENT", 10)
    scene = Scene(tmp_path, 28, rate)
    fakes.write_heads(tmp_path / "heads", 28, rate)
    clip = PreparedClip.load(scene.prepared)
    read, settings = partial(read_heads, tmp_path / "heads"), VideoSettings(codec=codec)
    composed: list[int] = []
    compose, cut = composer.Composer.frame, media.cut
    cuts = []

    def noted(video: Path, out: Path, *span: int) -> None:
        cuts.append(span)
        cut(video, out, *span)

    monkeypatch.setattr(media, "cut", noted)

    def counted(self: composer.Composer, *of: Any) -> Any:
        composed.append(of[-1])
        return compose(self, *of)

    monkeypatch.setattr(composer.Composer, "frame", counted)

    def made(name: str, digests: str, last: Path | None) -> bytes:
        heads = Heads(
            *(read, clip, 0, 28, kept_of(clip)),
            made_of=lambda first, _count: [digests[first // 10]],
        )
        sound = recording(scene.audio, 0.0, float(28 / rate), 28)
        out, poses = tmp_path / name, np.arange(28)
        composed.clear()
        return make(
            *([heads], sound, out), pose_index=poses, settings=settings, progress=quiet, last=last
        ).read_bytes()

    whole = made("one", "aaa", None)
    assert sorted(composed) == [*range(28)]
    exact = codec != "ffv1"  # in Matroska times are rounded
    assert made("two", "aba", tmp_path / "one") == whole
    assert sorted(composed) == [*range(10, 20)] if exact else [*range(28)]
    assert made("three", "abb", tmp_path / "two") == whole
    assert sorted(composed) == [*range(20, 28)] if exact else [*range(28)]
    # What lies side by side is cut out at once.
    assert cuts == ([(0, 10), (20, 8), (0, 20)] if exact else [])


def test_frames_that_an_edit_leaves_to_the_film_are_the_films_own(tmp_path: Path) -> None:
    scene = Scene(tmp_path, 28)
    fakes.write_heads(tmp_path / "heads", 28, scene.rate)
    clip = PreparedClip.load(scene.prepared)
    edit = Edit(film_mouth=((0.4, 0.8),))
    asked = edit.of_film(28, scene.rate)
    assert np.flatnonzero(asked).tolist() == [*range(10, 20)]
    read = partial(read_heads, tmp_path / "heads")
    heads = [Heads(read, clip, 0, 28, kept_of(clip), "line", asked)]
    sound = recording(scene.audio, 0.0, float(28 / scene.rate), 28)
    settings = VideoSettings(codec="ffv1", label=False)
    out = tmp_path / "out"
    path = make(heads, sound, out, pose_index=np.arange(28), settings=settings, progress=quiet)
    film = np.stack(list(media.read_frames(scene.clip)))
    same = [(own == made).all() for own, made in zip(film, media.read_frames(path), strict=True)]
    lost = 3  # no face was found there
    assert np.flatnonzero(same).tolist() == [lost, *range(10, 20)]
    picture = json.loads((out / PICTURE_FILE).read_text())
    kept = [(run["reason"], run["first"], run["stop"]) for run in picture["own_pixels"]]
    assert kept == [("no face", lost, lost + 1), ("asked for", 10, 20)]
    assert (picture["reach"]["line"]["frames"], picture["reach"]["line"]["dubbed"]) == (18, 17)


@pytest.mark.parametrize("codec", ["h264", "ffv1", "prores"])
def test_the_finished_sound_lies_where_it_was_recorded(tmp_path: Path, codec: str) -> None:
    scene, rate = Scene(tmp_path, 28, Fraction(30000, 1001)), 48000
    noise = clips.write_noise(tmp_path / "noise.wav", 3)
    fakes.write_heads(tmp_path / "heads", 28, scene.rate)
    clip = PreparedClip.load(scene.prepared)
    heads = [Heads(partial(read_heads, tmp_path / "heads"), clip, 0, 28, kept_of(clip))]
    settings, poses = VideoSettings(codec=codec, label=False), np.arange(28)
    whole = media.read_audio(noise, rate=rate)

    sound = recording(noise, 1.1234, float(28 / scene.rate), 28)
    out = make(heads, sound, tmp_path / "a", pose_index=poses, settings=settings, progress=quiet)
    heard = media.read_audio(out, rate=rate, seconds=0.9)
    assert clips.lag(whole, heard) == round(1.1234 * rate)

    cue = Cue("ann", 7, 25, noise, 0.9, float(18 / scene.rate))
    lines = Sound((cue,), film_heard=True)
    heads = [Heads(partial(read_heads, tmp_path / "heads"), clip, 7, 25, kept_of(clip))]
    out = make(heads, lines, tmp_path / "b", pose_index=poses, settings=settings, progress=quiet)
    first = round(7 * rate / scene.rate)
    # A seek would be as exact as the time stamps, which are milliseconds in Matroska.
    heard = media.read_audio(out, rate=rate)[first : first + rate // 2]
    assert clips.lag(whole, heard) == round(0.9 * rate)


def test_a_cut_dub_has_as_much_sound_as_picture(scene: Scene) -> None:
    out = scene.make(np.arange(6), seconds=2.0)
    assert media.probe(out).audio_duration == pytest.approx(6.5 / 25, abs=0.03)


def test_verify_counts_by_decoding(scene: Scene) -> None:
    verify(scene.clip, 12, Fraction(25))
    with pytest.raises(RenderingError, match="12 frames instead of 13"):
        verify(scene.clip, 13, Fraction(25))
    with pytest.raises(RenderingError, match="runs at 25 instead of 24"):
        verify(scene.clip, 12, Fraction(24))


def test_sound_that_begins_late_is_noticed(scene: Scene) -> None:
    late = scene.folder / "late.mkv"
    clips.ffmpeg(
        "-i", scene.clip, "-itsoffset", "0.2", "-i", scene.audio,
        *("-map", "0:v", "-map", "1:a", "-c:v", "copy", "-c:a", "flac", "-t", "0.4"), late,
    )  # fmt: skip
    with pytest.raises(RenderingError, match="sound begins"):
        verify(late, media.count_frames(late), Fraction(25))


def test_memory_does_not_grow_with_the_length(tmp_path: Path) -> None:
    """Peak memory of a process that composites n frames, for two n."""
    code = (
        "import resource, sys; from pathlib import Path; import numpy as np;"
        "from tests.dubbing.video.scene import Scene;"
        "s = Scene(Path(sys.argv[1]), 20); s.make(np.arange(int(sys.argv[2])) % 20);"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )

    def peak(frames: int) -> int:
        folder = tmp_path / str(frames)
        folder.mkdir()
        command, env = [sys.executable, "-c", code, str(folder), str(frames)], of_children()
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
        return int(done.stdout)

    assert (
        peak(200) < peak(20) + 10_000
    )  # KiB; frames that were kept would be 18 KiB each, and more
