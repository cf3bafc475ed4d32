from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.errors import MediaError
from tests import clips


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


def test_another_rate_keeps_time(clip: Path) -> None:
    got = [clips.number(f) for f in media.read_frames(clip, rate=Fraction(15))]
    assert len(got) == 150
    assert max(abs(k * 2 - seen) for k, seen in enumerate(got)) <= 1


def test_a_file_that_breaks_off_is_said(tmp_path: Path) -> None:
    whole = clips.write_video(tmp_path / "whole.mkv", 200, codec="ffv1")
    torn = tmp_path / "torn.mkv"
    torn.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    # What is there can be read: the count is that of the file, not of its header.
    assert 50 < media.probe(torn).frames < 150
    with pytest.raises(MediaError, match="broke off"):
        list(_promising(torn, 200))


def _promising(path: Path, frames: int) -> list[np.ndarray]:
    """Read as if the file had promised more frames than it holds."""
    from dataclasses import replace
    from unittest.mock import patch

    from dubbing.media import reading

    info = replace(media.probe(path), frames=frames)
    with patch.object(reading, "probe", lambda _: info):
        return list(media.read_frames(path))


def test_closing_early_ends_ffmpeg(clip: Path) -> None:
    frames = media.read_frames(clip)
    next(frames)
    frames.close()  # type: ignore[attr-defined]


@pytest.mark.parametrize(("rate", "channels"), [(8000, 1), (44100, 2), (48000, 6)])
def test_sound_is_the_mean_of_its_channels(tmp_path: Path, rate: int, channels: int) -> None:
    import soundfile

    wave = clips.tone(1.0, rate, channels)
    wave[:, 1:] = 0  # only the first channel sounds
    soundfile.write(tmp_path / "a.wav", wave, rate)
    got = media.read_audio(tmp_path / "a.wav")
    assert got.dtype == np.float32
    assert abs(len(got) - 16000) <= 16
    expected = clips.tone(1.0)[:, 0] / channels
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


def test_no_sound_is_said(tmp_path: Path) -> None:
    with pytest.raises(MediaError, match="no sound"):
        media.read_audio(clips.write_video(tmp_path / "v.mp4", 3))
