"""Timecodes that count at another rate than the frames."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from dubbing import media
from dubbing.media.probing.timecode_track import MOV, MXF
from tests import clips

# Rate of the film, of its timecode track, the timecode in it, and the film's first frame.
CASES = [
    (Fraction(60000, 1001), Fraction(30000, 1001), "01:00:00:20", 3600 * 60 + 40),
    (Fraction(60000, 1001), Fraction(30000, 1001), "00:01:00;02", 3600),
    (Fraction(120000, 1001), Fraction(30000, 1001), "00:00:01:29", 120 + 116),
    (Fraction(120000, 1001), Fraction(60000, 1001), "00:10:00;00", 4 * 17982),
    (Fraction(50), Fraction(25), "10:00:00:24", 36000 * 50 + 48),
    (Fraction(48000, 1001), Fraction(24000, 1001), "01:00:00:23", 3600 * 48 + 46),
    (Fraction(30000, 1001), Fraction(60000, 1001), "01:00:00:40", 3600 * 30 + 20),
    (Fraction(25), Fraction(25), "01:00:00:24", 3600 * 25 + 24),
    (Fraction(120000, 1001), Fraction(120000, 1001), "00:01:00;008", 7200),
]


def film_with(folder: Path, rate: Fraction, count: Fraction, timecode: str) -> Path:
    """A film of a rate with a timecode track of another."""
    film = clips.write_video(folder / "film.mov", 12, rate)
    track, both = folder / "track.mov", folder / "both.mov"
    # Written without drop frame, which a copy loses.
    clips.ffmpeg(
        *("-i", clips.write_video(folder / "other.mov", 6, count), "-c", "copy"),
        *("-r", str(count), "-timecode", timecode, track),
    )
    maps = ("-map", "0:v", "-map", "1:d", "-c", "copy", "-r", str(rate))
    clips.ffmpeg("-i", film, "-i", track, *maps, both)
    if ";" in timecode:
        content = bytearray(both.read_bytes())
        found = MOV.search(content)
        assert found is not None
        content[found.end() - 10] |= 1  # the last byte of its flags: drop frame
        both.write_bytes(content)
    return both


@pytest.mark.parametrize(("rate", "count", "timecode", "first"), CASES)
def test_a_timecode_counts_at_its_own_rate(
    tmp_path: Path, rate: Fraction, count: Fraction, timecode: str, first: int
) -> None:
    info = media.probe(film_with(tmp_path, rate, count, timecode))
    assert (info.rate, info.timecode_rate) == (rate, count)
    assert (info.timecode, info.first_frame) == (timecode, first)
    assert info.timecode_at(0) == timecode
    # A result has a number for every frame; it begins at the same moment.
    made = tmp_path / "made.mov"
    sound = clips.write_sound(tmp_path / "a.wav", 1)
    written = info.full_timecode_at(0)
    media.mux(info.path, sound, made, audio_start=0, seconds=0.1, timecode=written)
    again = media.probe(made)
    assert (again.timecode, again.timecode_rate, again.first_frame) == (written, rate, first)


def test_a_timecode_that_does_not_fit_the_rate_is_none(tmp_path: Path) -> None:
    film = film_with(tmp_path, Fraction(25), Fraction(30), "01:00:00:12")
    assert media.probe(film).timecode == ""


def test_the_timecode_base_of_mxf(tmp_path: Path) -> None:
    film = tmp_path / "film.mxf"
    clips.ffmpeg(
        *("-f", "lavfi", "-i", "testsrc2=s=64x48:r=50:d=0.4", "-c:v", "mpeg2video"),
        *("-timecode", "01:00:00:10", film),
    )
    assert media.probe(film).first_frame == 3600 * 50 + 10
    film.write_bytes(MXF.sub(b"\x15\x02\x00\x02\x00\x19", film.read_bytes()))
    info = media.probe(film)
    assert (info.timecode_rate, info.first_frame % 50) == (25, 20)
