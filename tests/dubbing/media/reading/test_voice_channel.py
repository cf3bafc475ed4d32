"""A voice is heard whatever its channels are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.media.reading.voice_channel import is_silent, voice_channel
from tests import clips

RATE = 16000
NOISE = np.random.default_rng(0).normal(size=(3, 2 * RATE)).astype(np.float32) * 0.1
A, B, C = NOISE
NOTHING = np.zeros_like(A)
# Channels, what is heard, and why.
CASES = {
    "equal": ([A, A], A, ""),
    "unlike": ([A, B], (A + B) / 2, ""),
    "opposed": ([A, -A], A, "opposed"),
    "opposed, the second louder": ([A / 2, -A], -A, "opposed"),
    "nearly opposed": ([A, -A + B / 5], A, "opposed"),
    "left alone": ([A, NOTHING], A, "unused"),
    "right alone": ([NOTHING, A], A, "unused"),
    "almost nothing in one": ([A, B / 1000], A, "unused"),
    "centre alone": ([NOTHING, NOTHING, A, NOTHING, NOTHING, NOTHING], A, "unused"),
    "two of four": ([A, B, NOTHING, NOTHING], (A + B) / 2, "unused"),
    "offset alone in one": ([A, NOTHING + 0.1], A, "unused"),
    "opposed for a while": ([A, np.concatenate([A[:RATE], -A[RATE:]])], A, "opposed"),
    "silent": ([NOTHING, NOTHING], NOTHING, ""),
}


def written(path: Path, channels: list[np.ndarray], subtype: str = "FLOAT") -> Path:
    soundfile.write(path, np.stack(channels, 1), RATE, subtype=subtype)
    return path


@pytest.mark.parametrize("case", CASES)
def test_the_voice_is_heard(tmp_path: Path, case: str) -> None:
    channels, heard, why = CASES[case]
    path = written(tmp_path / "a.wav", channels)
    np.testing.assert_allclose(media.read_audio(path), heard, atol=1e-5)
    mono = np.concatenate(list(media.iter_channels(path, rate=RATE, channels=1)))
    np.testing.assert_allclose(mono[:, 0], heard, atol=1e-5)
    info = media.probe(path)
    assert voice_channel(info, 0.0, None).why == why
    assert is_silent(info, 0.0, 2.0) == (not heard.any())


@pytest.mark.parametrize(
    ("centre", "why", "share"),
    [(1.0, "centre", 1.0), (0.02, "", 1 / 6), (0.0, "unused", 0.0)],
)
def test_dialogue_is_in_the_centre(tmp_path: Path, centre: float, why: str, share: float) -> None:
    """Of sound that says which channel that is; a wave file need not."""
    path, named = tmp_path / "a.wav", tmp_path / "named.wav"
    written(path, [B / 2, C / 2, A * centre, NOTHING + B / 50, B / 3, C / 3])
    clips.ffmpeg("-i", path, "-c:a", "pcm_f32le", named)
    found = voice_channel(media.probe(named), 0.0, None)
    assert (found.why, found.weights[2]) == (why, pytest.approx(share))
    if why == "centre":
        np.testing.assert_allclose(media.read_audio(named), A, atol=1e-5)
    assert voice_channel(media.probe(path), 0.0, None).why != "centre"


def test_a_constant_offset_is_silence(tmp_path: Path) -> None:
    info = media.probe(written(tmp_path / "a.wav", [NOTHING + 0.1]))
    assert is_silent(info, 0.0, 2.0)


@pytest.mark.parametrize("subtype", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"])
def test_every_format_of_samples(tmp_path: Path, subtype: str) -> None:
    quiet = np.zeros(RATE, np.float32)
    info = media.probe(written(tmp_path / "a.wav", [quiet, quiet], subtype))
    assert is_silent(info, 0.0, 1.0)
    info = media.probe(written(tmp_path / "b.wav", [A, -A], subtype))
    assert not is_silent(info, 0.0, 1.0)
    assert voice_channel(info, 0.0, None).why == "opposed"


def test_each_stretch_has_its_own_channel(tmp_path: Path) -> None:
    path = written(tmp_path / "a.wav", [A, np.concatenate([A[:RATE], -A[RATE:]])])
    info = media.probe(path)
    assert [voice_channel(info, start, 1.0).why for start in (0.0, 1.0)] == ["", "opposed"]
    np.testing.assert_allclose(media.read_audio(path, start=1.0), A[RATE:], atol=1e-5)


def test_a_long_sound_is_looked_at_here_and_there(tmp_path: Path) -> None:
    path = written(tmp_path / "a.wav", [np.tile(A, 60), np.tile(-A, 60)], "PCM_16")
    assert voice_channel(media.probe(path), 0.0, None).taken == "1"


def test_silence_is_of_a_stretch(tmp_path: Path) -> None:
    info = media.probe(written(tmp_path / "a.wav", [np.concatenate([A, NOTHING, A])]))
    assert [is_silent(info, start, 1.5) for start in (0.0, 2.2, 3.0)] == [False, True, False]
    assert is_silent(info, 7.0, 1.0)  # nothing is there


def test_channels_in_tracks_of_their_own(tmp_path: Path) -> None:
    one, two = written(tmp_path / "1.wav", [A]), written(tmp_path / "2.wav", [-A])
    path = tmp_path / "both.mka"
    clips.ffmpeg("-i", one, "-i", two, "-map", "0", "-map", "1", "-c:a", "copy", path)
    assert media.probe(path).audio_channels == 2
    np.testing.assert_allclose(media.read_audio(path), A, atol=1e-4)


def test_a_changed_file_is_looked_at_anew(tmp_path: Path) -> None:
    path = written(tmp_path / "a.wav", [A, A])
    assert voice_channel(media.probe(path), 0.0, None).why == ""
    written(path, [A, -A], "PCM_16")
    assert voice_channel(media.probe(path), 0.0, None).why == "opposed"


def test_damaged_packets_are_left_out(tmp_path: Path) -> None:
    whole, damaged = tmp_path / "whole.mka", tmp_path / "damaged.mka"
    sound = written(tmp_path / "a.wav", [A, -A])
    clips.ffmpeg("-i", sound, "-c:a", "mp2", whole)
    content = bytearray(whole.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(40)
    damaged.write_bytes(content)
    info = media.probe(damaged)
    assert not is_silent(info, 0.9, 0.2)
    assert voice_channel(info, 0.0, None).why == "opposed"
