from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.errors import MediaError
from dubbing.media.opening.ffmpeg import Process
from dubbing.media.reading import reading
from tests import clips

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """300 frames: more than one group of pictures, with B-frames."""
    return clips.write_clip(tmp_path_factory.mktemp("reading") / "c.mp4", 300, Fraction(30))


def test_every_frame_comes_out_in_order(clip: Path) -> None:
    assert [clips.number(f) for f in media.read_frames(clip)] == list(range(300))


@pytest.mark.parametrize("start", [1, 19, 20, 21, 124, 249, 250, 251, 299])
def test_starting_late_gives_the_same_frames(clip: Path, start: int) -> None:
    got = [clips.number(f) for f in media.read_frames(clip, start=start, count=3)]
    assert got == list(range(start, min(start + 3, 300)))


def test_starting_late_is_bit_exact(clip: Path) -> None:
    linear = list(media.read_frames(clip, count=130))
    late = list(media.read_frames(clip, start=123, count=7))
    for a, b in zip(linear[123:], late, strict=True):
        np.testing.assert_array_equal(a, b)


def test_packets_that_run_late_do_not_shift_a_seek(tmp_path: Path) -> None:
    """Decoding times ahead of showing times by two frames, without an edit list."""
    plain = clips.write_video(tmp_path / "plain.mp4", 300)
    late = tmp_path / "late.mp4"
    clips.ffmpeg("-i", plain, "-c", "copy", "-use_editlist", "0", late)
    shown = [clips.number(f) for f in media.read_frames(late)]
    for start in (60, 249, 250, 251, 252, 253):
        got = [clips.number(f) for f in media.read_frames(late, start=start, count=4)]
        assert got == shown[start : start + 4]


@pytest.mark.parametrize("codec", ["libx264", "mpeg4"])
def test_frames_of_an_avi_are_where_its_sound_is(tmp_path: Path, clip: Path, codec: str) -> None:
    """It has no times of display, and ffmpeg guesses those of B-frames too late."""
    path, coder = tmp_path / "b.avi", ("-c:v", codec, "-bf", "2", "-q:v", "3", "-g", "40")
    clips.ffmpeg("-i", clip, *coder, "-c:a", "pcm_s16le", path)
    info = media.probe(path)
    assert (info.frames, info.video_start, info.late > 0) == (300, 0, True)
    assert [clips.number(f) for f in media.read_frames(path)] == list(range(300))
    for start in (1, 39, 40, 42, 251):
        (one,) = media.read_frames(path, start=start, count=1)
        assert clips.number(one) == start


def test_another_rate_keeps_time(clip: Path) -> None:
    got = [clips.number(f) for f in media.read_frames(clip, rate=Fraction(15))]
    assert len(got) == 150
    assert max(abs(k * 2 - seen) for k, seen in enumerate(got)) <= 1


def test_a_file_that_breaks_off_is_reported(tmp_path: Path) -> None:
    whole = clips.write_video(tmp_path / "whole.mkv", 20, codec="ffv1")
    with pytest.raises(MediaError, match="broke off"):
        list(_promising(whole, 40))


def _promising(path: Path, frames: int) -> list[np.ndarray]:
    """Read as if the file had promised more frames than it holds."""
    info = replace(media.probe(path), frames=frames)
    with patch.object(reading, "probe", lambda _: info):
        return list(media.read_frames(path))


def test_closing_early_ends_ffmpeg(clip: Path) -> None:
    started: list[Process] = []

    def start(*arguments: Any, **options: Any) -> Process:
        started.append(Process(*arguments, **options))
        return started[-1]

    with patch.object(reading, "Process", start):
        frames = media.read_frames(clip)
        next(frames)
        frames.close()  # type: ignore[attr-defined]
    assert [process._process.poll() is None for process in started] == [False]


@pytest.mark.parametrize(("rate", "channels"), [(8000, 1), (44100, 2), (48000, 6)])
def test_sound_is_the_mean_of_its_channels(tmp_path: Path, rate: int, channels: int) -> None:
    wave = clips.tone(1.0, rate, channels)
    wave[:, 1:] /= 2  # the first channel is louder
    soundfile.write(tmp_path / "a.wav", wave, rate)
    got = media.read_audio(tmp_path / "a.wav")
    assert got.dtype == np.float32
    assert abs(len(got) - 16000) <= 16
    expected = clips.tone(1.0)[:, 0] * (1 + channels) / (2 * channels)
    middle = slice(2000, 14000)
    assert np.abs(got[middle] - expected[middle]).max() < 0.01


def test_a_part_of_the_sound(tmp_path: Path) -> None:
    path = clips.write_sound(tmp_path / "a.wav", 3)
    whole = media.read_audio(path)
    part = media.read_audio(path, start=1.0, seconds=0.5)
    np.testing.assert_allclose(part, whole[16000:24000], atol=1e-4)
    blocks = list(media.iter_audio(path, block_seconds=0.7))
    assert [len(b) for b in blocks] == [11200, 11200, 11200, 11200, 3200]
    np.testing.assert_array_equal(np.concatenate(blocks), whole)


def test_sound_that_begins_late_keeps_its_place(tmp_path: Path) -> None:
    picture = clips.write_video(tmp_path / "v.mp4", 50)
    sound = clips.write_sound(tmp_path / "a.wav", 1)
    late = tmp_path / "late.mkv"
    clips.ffmpeg("-i", picture, "-itsoffset", "0.5", "-i", sound, "-c:v", "copy", late)
    got = media.read_audio(late)
    assert np.abs(got[:7800]).max() < 1e-3
    assert np.abs(got[8200:9000]).max() > 0.1


@pytest.mark.parametrize("name", ["late.mkv", "late.ts"])
def test_sound_that_begins_late_is_heard_where_it_belongs(tmp_path: Path, name: str) -> None:
    """A click at 2.5 s: sound that is read, that is read from 1 s on, and that is muxed from."""
    wave = np.zeros(16000 * 3, np.float32)
    wave[16000:16800] = 0.5
    soundfile.write(tmp_path / "a.wav", wave, 16000)
    picture, late = clips.write_video(tmp_path / "v.mp4", 100), tmp_path / name
    sound = ("-itsoffset", "1.5", "-i", tmp_path / "a.wav", "-c:a", "aac", "-bf", "0")
    clips.ffmpeg("-i", picture, *sound, late)
    media.mux(picture, late, tmp_path / "o.mkv", audio_start=1, seconds=3, audio_codec="flac")
    for path, start in ((late, 0.0), (late, 1.0), (tmp_path / "o.mkv", 0.0)):
        heard = media.read_audio(path, start=start)
        at = start + np.flatnonzero(np.abs(heard) > 0.25)[0] / 16000
        assert at == pytest.approx(1.5 if path.name == "o.mkv" else 2.5, abs=0.01)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("late_key.avi", "-c:v libx264 -bf 2 -c:a pcm_s16le"),
        ("packets.avi", "-c:v mpeg4 -bf 2 -c:a libmp3lame"),
        ("late_key.flv", "-c:v libx264 -bf 2 -c:a aac"),
        ("gap.mp4", "-c:v libx264 -bf 2 -c:a aac -movflags frag_keyframe+empty_moov"),
        ("plain.mkv", "-c:v libx264 -c:a aac"),
    ],
)
def test_a_part_of_the_sound_is_that_of_the_whole(tmp_path: Path, name: str, options: str) -> None:
    """Key frames of the picture come later than its sound, packets do not begin where asked."""
    picture, path = clips.write_video(tmp_path / "v.mp4", 200), tmp_path / name
    noise = clips.write_noise(tmp_path / "a.wav", 8, 44100)
    clips.ffmpeg("-i", picture, "-i", noise, *options.split(), path)
    whole = media.read_audio(path)
    assert whole[:4000].std() > 0.5 * whole.std()
    for start in (0.01, 0.5, 3.3, 5.7):
        begin = round(16000 * start)
        part, there = media.read_audio(path, start=start, seconds=1.0), whole[begin:][:16000]
        assert abs(clips.lag(part, there)) <= 16, start  # 1 ms, as Matroska counts


def test_no_sound_is_reported(tmp_path: Path) -> None:
    with pytest.raises(MediaError, match="no sound"):
        media.read_audio(clips.write_video(tmp_path / "v.mp4", 3))


def test_a_decoder_that_stops_early_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clips.write_sound(tmp_path / "it.wav", 2.0)
    assert len(media.read_audio(tmp_path / "it.wav", rate=16000)) == 32000
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\nhead -c 64000 /dev/zero\n")
    program.chmod(0o755)
    monkeypatch.setenv("DFRF_FFMPEG", str(program))
    with pytest.raises(MediaError, match=r"only 1\.0 s of 2\.0 s of its sound can be decoded"):
        media.read_audio(tmp_path / "it.wav", rate=16000)
    assert len(media.read_audio(tmp_path / "it.wav", rate=16000, seconds=1)) == 16000


LONG = ("-c:v", "libx264", "-g", "250", "-keyint_min", "250", "-sc_threshold", "0", "-crf", "18")
# What seeks differ by: no index, key frames far apart, a picture that begins after the sound,
# key frames that begin no group, intra refresh, edit lists, times far from 0.
CONTAINERS = {
    "long.ts": (*LONG, "-an"),
    "sound.ts": (*LONG, "-c:a", "aac"),
    "late.ts": (*LONG, "-c:a", "aac", "-filter:v", "setpts=PTS+1.5/TB"),
    "far.ts": (*LONG, "-an", "-output_ts_offset", "3000"),
    "open.ts": ("-c:v", "libx264", "-g", "60", "-x264-params", "open-gop=1", "-an"),
    "refresh.ts": ("-c:v", "libx264", "-x264-params", "intra-refresh=1:keyint=100", "-an"),
    "mpeg2.mpg": ("-c:v", "mpeg2video", "-g", "200", "-bf", "2", "-q:v", "3", "-c:a", "mp2"),
    "long.mkv": (*LONG, "-c:a", "aac"),
    "edited.mp4": (*LONG, "-c:a", "aac"),
}


@pytest.mark.parametrize("name", list(CONTAINERS))
def test_a_seek_gives_what_was_requested(clip: Path, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    clips.ffmpeg("-i", clip, *CONTAINERS[name], "-preset", "veryfast", path)
    if name == "edited.mp4":
        clips.ffmpeg("-ss", "2", "-i", path, "-c", "copy", tmp_path / "cut.mp4")
        path = tmp_path / "cut.mp4"
    info = media.probe(path)
    whole = list(media.read_frames(path))
    assert len(whole) == info.frames
    numbers = [clips.number(f) for f in whole]
    # Frame k is shown at k / rate, counted from the start of the file, sound included.
    lag = info.video_start * float(info.rate or 0) + (-60 if name == "edited.mp4" else 0)
    for k, seen in enumerate(numbers):
        assert abs(seen - min(max(k - lag, 0), 299)) <= 0.51, (k, seen)
    for start in (*range(7, len(whole), 41), 79, 249, 250, 251):
        got = list(media.read_frames(path, start=start, count=3))
        assert [clips.number(f) for f in got] == numbers[start : start + 3]
        np.testing.assert_array_equal(got, whole[start : start + 3])
