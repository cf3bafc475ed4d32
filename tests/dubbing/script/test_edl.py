from __future__ import annotations

from fractions import Fraction

from dubbing.script.edl import MOST_EVENTS, Marker, edl
from dubbing.script.timecode import timecode_of

TV = Fraction(30000, 1001)


def test_an_event_a_marker_with_the_films_timecode() -> None:
    markers = [Marker(10, 20, "green", "1 ANN pass: Good\nevening | now\x1b")]
    text = edl("it", markers, lambda k: timecode_of(90000 + k, Fraction(25)), drop=False)
    assert text.splitlines() == [
        "TITLE: it",
        "FCM: NON-DROP FRAME",
        "",
        "001  001      V     C        01:00:00:10 01:00:00:20 01:00:00:10 01:00:00:20",
        "* LOC: 01:00:00:10 GREEN   1 ANN pass: Good evening | now",
        " |C:ResolveColorGreen |M:1 ANN pass: Good evening / now |D:10",
        "",
    ]


def test_drop_frame_and_a_full_list() -> None:
    markers = [Marker(k, k + 1, "red", "x") for k in range(1798, 1798 + MOST_EVENTS + 2)]
    text = edl("it", markers, lambda k: timecode_of(k, TV, drop=True), drop=True)
    assert "FCM: DROP FRAME" in text
    assert "00:00:59;29 00:01:00;02" in text
    assert text.count("* LOC:") == MOST_EVENTS
    assert "* 2 MORE LINES" in text
