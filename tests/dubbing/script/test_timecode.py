from __future__ import annotations

from fractions import Fraction

import pytest

from dubbing.script.timecode import frame_of, timecode_of

FILM, TV, PAL = Fraction(24000, 1001), Fraction(30000, 1001), Fraction(25)


@pytest.mark.parametrize(
    ("timecode", "rate", "frame"),
    [
        ("00:00:00:00", PAL, 0),
        ("00:01:05:12", PAL, 65 * 25 + 12),
        ("01:00:00:00", FILM, 3600 * 24),
        ("00:00:59;29", TV, 1799),
        ("00:01:00;02", TV, 1800),  # ;00 and ;01 are left out
        ("00:10:00;00", TV, 17982),  # but not every tenth minute
        ("01:00:00;00", TV, 107892),
        ("00:01:00;04", Fraction(60000, 1001), 3600),
        ("00:01:00;008", Fraction(120000, 1001), 7200),
    ],
)
def test_frames_and_timecodes(timecode: str, rate: Fraction, frame: int) -> None:
    assert frame_of(timecode, rate) == frame
    assert timecode_of(frame, rate, drop=";" in timecode) == timecode


def test_drop_frame_of_premiere_has_semicolons_alone() -> None:
    assert frame_of("00;01;00;02", TV) == 1800
    with pytest.raises(ValueError, match="left out"):
        frame_of("00;01;00;00", TV)


def test_drop_frame_keeps_up_with_the_clock() -> None:
    for frame in range(0, 110_000, 997):
        assert frame_of(timecode_of(frame, TV, drop=True), TV) == frame
    assert abs(float(frame_of("01:00:00;00", TV) / TV) - 3600) < 0.01


@pytest.mark.parametrize(
    ("timecode", "rate", "message"),
    [
        ("00:00:01:25", PAL, "frame 25, but there are 25 a second"),
        ("00:01:00;00", TV, "left out"),
        ("00:01:00;02", PAL, "drops frames"),
        ("1:05", PAL, "no timecode"),
    ],
)
def test_what_is_no_timecode(timecode: str, rate: Fraction, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        frame_of(timecode, rate)
