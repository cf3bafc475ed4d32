"""Final Cut's XML: clips in lanes, on their own clocks, and films above them."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from dubbing.timelines import fcpxml, reading
from tests.dubbing.timelines import cuts

RESOURCES = """
<format id="r1" frameDuration="100/2500s"/><format id="r2" frameDuration="1001/24000s"/>
<asset id="a" name="a" start="3600s" duration="20s" hasVideo="1" format="r1" src="file:///a.mov"/>
<asset id="b" name="b" start="0s" duration="20s" hasVideo="1" format="r1" src="file:///b.mov"/>
<asset id="c" name="c" start="1001/24s" duration="20s" hasVideo="1" format="r2" src="file:///c.mov"/>
<asset id="s" name="s" start="0s" duration="20s" hasVideo="0" hasAudio="1" src="file:///s.wav"/>
<format id="r3" name="FFVideoFormatRateUndefined" width="64" height="48"/>
<asset id="i" name="i" start="0s" duration="0s" hasVideo="1" format="r3" src="file:///i.png"/>
<media id="m" name="m"><sequence format="r1"><spine/></sequence></media>
"""


def document(spine: str, start: str = "3600s") -> str:
    return (
        f'<fcpxml version="1.9"><resources>{RESOURCES}</resources><library><event><project'
        f' name="p"><sequence format="r1" tcStart="{start}" tcFormat="NDF"><spine>{spine}</spine>'
        "</sequence></project></event></library></fcpxml>"
    )


def found(spine: str) -> dict[str, tuple[float, float, float, str]]:
    """Source times and place on the timeline of each clip, in seconds, and why it is not dubbed."""
    timeline = fcpxml.read(document(spine))
    return {
        event.clip.name: (
            round(float(event.first / event.rate), 6),
            round(float(event.stop / event.rate), 6),
            round(float(event.record), 6),
            event.why_not,
        )
        for event in reading.cut_of(timeline).events
    }


def test_clips_in_lanes_count_from_the_clip_below() -> None:
    spine = """
    <asset-clip ref="a" name="low" offset="3600s" start="3605s" duration="4s">
      <asset-clip ref="b" name="high" lane="1" offset="3606s" start="2s" duration="1s"/>
      <spine lane="2" offset="3607s">
        <asset-clip ref="b" name="third" offset="0s" start="5s" duration="1s"/>
        <asset-clip ref="b" name="fourth" offset="1s" start="9s" duration="1s"/>
      </spine>
    </asset-clip>
    <gap offset="3604s" start="3600s" duration="2s">
      <asset-clip ref="b" name="over a gap" lane="1" offset="3601s" start="3s" duration="1s"/>
    </gap>
    <asset-clip ref="a" name="whole" duration="2s"/>
    """
    assert found(spine) == {
        "low": (3605, 3609, 0, ""),
        "high": (2, 3, 1, ""),
        "third": (5, 6, 2, ""),
        "fourth": (9, 10, 3, ""),
        "over a gap": (3, 4, 5, ""),
        "whole": (3600, 3602, 6, ""),  # where its film begins, after what is before it
    }


def test_a_clip_has_a_clock_of_its_own() -> None:
    spine = """
    <clip name="old" offset="3600s" start="10s" duration="2s">
      <video ref="a" offset="8s" start="3604s" duration="20s"/>
      <marker start="11s" duration="1/25s" value="here"/>
    </clip>
    """
    assert found(spine) == {"old": (3606, 3608, 0, "")}
    (event,) = reading.cut_of(fcpxml.read(document(spine))).events
    assert event.clip.markers[0].marked_range.start_time.to_seconds() == 3607
    assert event.notes == ("here",)


def test_another_rate_is_that_of_the_film() -> None:
    spine = '<asset-clip ref="c" name="c" offset="3600s" start="1201/24s" duration="1001/24s"/>'
    timeline = fcpxml.read(document(spine.replace("1201/24s", "2002/24s")))
    (event,) = reading.cut_of(timeline).events
    assert (event.first, event.stop, event.rate) == (2000, 3000, Fraction(24000, 1001))
    assert event.timecode == "01:00:00:00"  # of the timeline


def test_compositions_and_changed_speeds_are_no_films_to_dub_and_sound_is_no_picture() -> None:
    spine = """
    <ref-clip ref="m" name="nested" offset="3600s" duration="2s"/>
    <asset-clip ref="a" name="fast" offset="3602s" start="3600s" duration="2s">
      <timeMap><timept time="0s" value="0s"/><timept time="2s" value="4s"/></timeMap>
    </asset-clip>
    <asset-clip ref="s" name="sound" offset="3604s" duration="2s"/>
    <title name="titled" offset="3606s" duration="1s"/>
    """
    assert {name: why for name, (*_, why) in found(spine).items()} == {
        "nested": reading.NESTED,
        "fast": reading.RETIMED,
    }


@pytest.mark.parametrize(("sequence", "clip"), [("DF", "NDF"), ("NDF", "DF")])
def test_a_timeline_drops_frames_where_its_sequence_does(
    tmp_path: Path, sequence: str, clip: str
) -> None:
    spine = f'<asset-clip ref="c" name="c" duration="1001/24s" tcFormat="{clip}"/>'
    text = document(spine, start="1800/1s").replace("100/2500s", "1001/30000s")
    (tmp_path / "a.fcpxml").write_text(
        text.replace('tcFormat="NDF"><spine>', f'tcFormat="{sequence}"><spine>')
    )
    cut = reading.read(tmp_path / "a.fcpxml", lambda _: ())
    assert cut.drop == (sequence == "DF")
    assert (";" in cut.events[0].timecode) == cut.drop


def test_a_still_has_no_frame_rate_and_is_no_film() -> None:
    spine = """
    <asset-clip ref="a" name="film" offset="3600s" start="3600s" duration="2s">
      <video ref="i" name="logo" lane="1" offset="3600s" start="3600s" duration="1s"/>
    </asset-clip>
    <video ref="i" name="card" offset="3602s" start="3600s" duration="2s"/>
    <asset-clip ref="a" name="after" offset="3604s" start="3604s" duration="1s"/>
    """
    assert found(spine) == {"film": (3600, 3602, 0, ""), "after": (3604, 3605, 4, "")}


def test_what_is_not_seen_is_not_dubbed() -> None:
    spine = """
    <asset-clip ref="a" name="off" offset="3600s" start="3600s" duration="2s" enabled="0">
      <asset-clip ref="b" name="over it" lane="1" offset="3600s" start="1s" duration="1s"/>
      <asset-clip ref="b" name="heard" lane="2" offset="3600s" duration="1s" srcEnable="audio"/>
    </asset-clip>
    <audition offset="3602s">
      <asset-clip ref="a" name="picked" start="3604s" duration="2s"/>
      <asset-clip ref="b" name="other" duration="2s"/>
    </audition>
    <asset-clip ref="a" name="after" start="3606s" duration="1s"/>
    """
    assert found(spine) == {
        "over it": (1, 2, 0, ""),
        "picked": (3604, 3606, 2, ""),
        "after": (3606, 3607, 4, ""),
    }


@pytest.mark.parametrize(
    ("scaled", "why"), [("", reading.RETIMED), ('scaleEnabled="1"', reading.RETIMED),
                        ('scaleEnabled="0"', "")],
)  # fmt: skip
def test_a_film_played_at_the_rate_of_the_timeline_is_retimed(scaled: str, why: str) -> None:
    """At 25 frames a second, of a film of 23.976."""
    clip = '<asset-clip ref="c" name="c" offset="3600s" duration="2002/48s">{}</asset-clip>'
    (event,) = found(clip.format(f'<conform-rate {scaled} srcFrameRate="23.98"/>')).values()
    assert event[3] == why


def test_a_transition_reaches_into_both_clips() -> None:
    spine = """
    <asset-clip ref="a" name="one" offset="3600s" start="3602s" duration="2s"/>
    <transition name="Dissolve" offset="3601s" duration="2s"/>
    <asset-clip ref="b" name="two" offset="3602s" start="5s" duration="2s"/>
    """
    one, two = reading.cut_of(fcpxml.read(document(spine))).events
    assert [time / 25 for time in one.shown] == [3602, 3605]
    assert [time / 25 for time in two.shown] == [4, 7]


@pytest.mark.parametrize(
    "text",
    [
        "<fcpxml/>",
        document("").replace("<project", "<project><sequence/></project><project"),
        document("").replace("1/25", "0"),
        '<!DOCTYPE fcpxml [<!ENTITY a "b">]>' + document(""),
    ],
)
def test_what_holds_no_project_is_refused(text: str) -> None:
    if "2500s" in text and "ENTITY" not in text and text.count("<project") == 1:
        text = text.replace("100/2500s", "0s")
    with pytest.raises(ValueError, match=r"project|frame rate|entities"):
        fcpxml.read(text)


def test_a_film_lies_in_the_lane_above_and_all_else_stays() -> None:
    spine = """
    <asset-clip ref="a" name="low" offset="3600s" start="3605s" duration="4s"><note>n</note>
      <asset-clip ref="b" name="high" lane="1" offset="3606s" start="2s" duration="1s"/>
      <marker start="3606s" duration="1/25s" value="theirs"/>
    </asset-clip>
    """
    text = document(spine)
    timeline: Any = fcpxml.read(text)
    place = next(clip.metadata[fcpxml.PLACE] for clip in timeline.tracks[0])
    rate = Fraction(25)
    media = cuts.otio.schema.ExternalReference("file:///dub.mov", cuts.span(90100, 90250, rate))
    above = cuts.otio.schema.Clip("dub.mov", media, cuts.span(90125, 90225, rate))
    above.markers.append(cuts.otio.schema.Marker("look", cuts.span(90150, 90200, rate)))
    written = fcpxml.laid_over(text, {place: above})
    root = ElementTree.fromstring(written)
    low = root.find(".//spine/asset-clip")
    assert low is not None
    assert [child.tag for child in low] == ["note", "asset-clip", "asset-clip", "marker"]
    assert low[2].attrib == {
        "ref": "dub1",
        "name": "dub.mov",
        "lane": "2",
        "offset": "3605s",
        "start": "3605s",
        "duration": "4s",
        "srcEnable": "video",
    }
    assert low[2][0].attrib == {"value": "look", "start": "3606s", "duration": "2s"}
    low.remove(low[2])
    new = root.find("resources/asset[@id='dub1']")
    shelf = root.find("resources")
    assert new is not None
    assert shelf is not None
    assert (new.get("start"), new.get("duration"), new.get("src")) == (
        "3604s",
        "6s",
        media.target_url,
    )
    shelf.remove(new)
    before = ElementTree.fromstring(text)

    def plain(node: ElementTree.Element) -> str:
        return ElementTree.canonicalize(ElementTree.tostring(node), strip_text=True)

    assert plain(root) == plain(before)


assert cuts.otio  # skips this file where the extra is missing
