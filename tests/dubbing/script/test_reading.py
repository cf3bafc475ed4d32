from __future__ import annotations

import contextlib
from fractions import Fraction
from pathlib import Path

import pytest

from dubbing.errors import ExplainedError
from dubbing.script.line import Line
from dubbing.script.reading import read_lines

pytestmark = pytest.mark.medium

FILM = Fraction(24000, 1001)
SRT = """1
00:00:01,000 --> 00:00:02,500
ANNA: Good evening.
And <i>welcome</i>.

2
00:00:03,000 --> 00:00:04,000
[BEN] At 10: 30 it begins.

3
00:01:05,500 --> 00:01:06,000
nobody says this
"""
VTT = """WEBVTT

intro
00:01.000 --> 00:02.500 align:start
<v Anna>Good evening</v>

00:00:03.000 --> 00:00:04.000
<v.loud Ben>Now</v>
"""
ASS = """[Script Info]
ScriptType: v4.00+
[V4+ Styles]
Format: Name, Fontname, Fontsize
Style: Default,Arial,20
[Events]
Format: Layer, Start, End, Style, Name, MarginL, MarginR, MarginV, Effect, Text
Comment: 0,0:00:00.00,0:00:09.00,Default,X,0,0,0,,a note
Dialogue: 0,0:00:01.00,0:00:02.50,Default,Anna,0,0,0,,{\\i1}Good{\\i0}, evening
"""
TTML = """<?xml version="1.0" encoding="UTF-8"?>
<tt xmlns="http://www.w3.org/ns/ttml" xmlns:ttm="http://www.w3.org/ns/ttml#metadata"
 xmlns:ttp="http://www.w3.org/ns/ttml#parameter" ttp:frameRate="24"
 ttp:frameRateMultiplier="1000 1001" {extra}>
<head><metadata><ttm:agent xml:id="a1"><ttm:name type="full">Anna</ttm:name></ttm:agent></metadata>
</head><body begin="1s"><div>
<p begin="00:00:01:12" end="00:00:02.5" ttm:agent="a1">Good<br/>evening</p>
<p begin="72f" dur="1500ms"><span ttm:agent="a1">Bye</span></p>
</div></body></tt>
"""
CSV = """in, out, speaker, words
1.5, 0:02.5, ANNA, "Good, evening"
00:00:03:12, 00:01:00:00, BEN, Now
"""


def read(folder: Path, name: str, text: str) -> list[Line]:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_lines(path, FILM)


def rows(lines: list[Line]) -> list[tuple[Fraction, Fraction, str, str]]:
    return [(line.start, line.stop, line.speaker, line.words) for line in lines]


def test_srt(tmp_path: Path) -> None:
    lines = read(tmp_path, "a.srt", "\ufeff" + SRT)
    assert [line.number for line in lines] == [1, 2, 3]
    assert rows(lines) == [
        (Fraction(1), Fraction(5, 2), "ANNA", "Good evening. And welcome."),
        (Fraction(3), Fraction(4), "BEN", "At 10: 30 it begins."),
        (Fraction(131, 2), Fraction(66), "", "nobody says this"),
    ]


def test_vtt_and_ass(tmp_path: Path) -> None:
    assert rows(read(tmp_path, "a.vtt", VTT)) == [
        (Fraction(1), Fraction(5, 2), "Anna", "Good evening"),
        (Fraction(3), Fraction(4), "Ben", "Now"),
    ]
    assert rows(read(tmp_path, "a.ass", ASS)) == [
        (Fraction(1), Fraction(5, 2), "Anna", "Good, evening")
    ]


def test_ttml_counts_frames_and_knows_agents(tmp_path: Path) -> None:
    assert rows(read(tmp_path, "a.ttml", TTML.format(extra=""))) == [
        # media time: seconds of a clock, and frames of 1001/24000 s beyond them
        (2 + 12 / FILM, Fraction(7, 2), "Anna", "Good evening"),
        (1 + 72 / FILM, 1 + 72 / FILM + Fraction(3, 2), "Anna", "Bye"),
    ]
    smpte = TTML.format(extra='ttp:timeBase="smpte"').replace("00:00:02.5", "00:00:02:12")
    assert read(tmp_path, "a.ttml", smpte)[0].start == 1 + 36 / FILM  # all of it is frames


@pytest.mark.parametrize("year", ["2006/04", "2006/10"])
def test_ttml_before_its_first_edition_has_a_frame_rate_too(tmp_path: Path, year: str) -> None:
    """Its parameters have another namespace: frame 12 of 30 is at 0.4 s."""
    text = TTML.format(extra='ttp:tickRate="10000000"').replace("72f", "15000000t")
    old = text.replace("/ns/ttml", f"/{year}/ttaf1")
    assert old.count("ttaf1") == 3
    found = rows(read(tmp_path, "a.dfxp", old))
    assert found == rows(read(tmp_path, "a.ttml", text))
    assert [row[0] for row in found] == [Fraction(5, 2), 2 + 12 / FILM]


def test_ttml_of_apple_rounds_its_frame_rate(tmp_path: Path) -> None:
    """iTunes Timed Text writes 999/1000 for 1000/1001, and drops frames with it."""
    text = TTML.format(extra='ttp:timeBase="smpte" ttp:dropMode="dropNTSC"')
    text = text.replace('"24"', '"30"').replace("1000 1001", "999 1000")
    text = text.replace("00:00:02.5", "00:01:00:02").replace('"1s"', '"0s"')
    assert read(tmp_path, "a.ttml", text)[0].stop == 1800 * Fraction(1001, 30000)


def test_csv(tmp_path: Path) -> None:
    assert rows(read(tmp_path, "a.csv", CSV)) == [
        (Fraction(3, 2), Fraction(5, 2), "ANNA", "Good, evening"),
        ((3 * 24 + 12) / FILM, 60 * 24 / FILM, "BEN", "Now"),
    ]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.srt", SRT),
        ("a.tsv", CSV.replace(",", "\t")),
        ("a.ttml", TTML.format(extra="").replace("UTF-8", "UTF-16")),
    ],
)
@pytest.mark.parametrize("order", ["utf-16-le", "utf-16-be"])
def test_utf_16_as_spreadsheets_save_it(tmp_path: Path, name: str, text: str, order: str) -> None:
    written, marked = tmp_path / name, tmp_path / f"marked_{name}"
    written.write_text(text, encoding="utf-8")
    marked.write_bytes(f"\ufeff{text}".encode(order))
    assert read_lines(marked, FILM) == read_lines(written, FILM)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.srt", SRT.replace("00:00:03,000 -->", "00:00:3x,000 -->"), "row 7: no times"),
        ("a.srt", SRT.replace("00:00:04,000", "00:00:03,000"), "line 2 ends at 3 s"),
        ("a.srt", "", "no subtitles|no line"),
        ("a.srt", SRT.replace("00:00:03,000 -->", "00:00:03,000"), "row 7: no times"),
        ("a.csv", "in,out,words\n1,2,x\n", "no column speaker"),
        ("a.csv", 'in,out,speaker,words\n1,2,A,"x\n3,4,B,y\n', "quotation mark"),
        ("a.csv", "in,out,speaker,words\n1,2,A,Oh, yes\n", "line 1 has more cells"),
        ("a.csv", "line,in,out,speaker,words\nA3,1,2,A,x\n", "line 1: 'A3' is no number"),
        ("a.csv", "in,out,speaker,words\n1,soon,A,x\n", "line 1: 'soon' is no time"),
        ("a.ttml", "<tt>", "no XML"),
        (
            "a.ttml",
            TTML.format(extra="").replace('dur="1500ms"', ""),
            "paragraph at 4.003 s has no",
        ),
        ("a.ttml", "<!DOCTYPE tt [<!ENTITY a 'b'>]><tt>&a;</tt>", "declares entities"),
        ("a.ttml", TTML.format(extra="").replace('"24"', '"0"'), "frame rate"),
        ("a.doc", "x", "no kind of script"),
    ],
)
def test_what_is_no_script(tmp_path: Path, name: str, text: str, message: str) -> None:
    with pytest.raises(ExplainedError, match=message):
        read(tmp_path, name, text)


def test_numbers_are_those_that_are_printed(tmp_path: Path) -> None:
    srt = SRT.replace("\n2\n", "\n7\n").replace("\n3\n", "\n9\n")
    assert [line.number for line in read(tmp_path, "a.srt", srt)] == [1, 7, 9]
    tight = srt.replace("\n\n", "\n")  # no row between the cues
    assert rows(read(tmp_path, "a.srt", tight)) == rows(read(tmp_path, "a.srt", srt))
    assert [line.number for line in read(tmp_path, "a.srt", tight)] == [1, 7, 9]
    vtt = VTT.replace("intro", "NOTE not spoken\n00 --> 01\n\n12").replace(
        "\n\n00:00:03", "\n\n14\n00:00:03"
    )
    assert [line.number for line in read(tmp_path, "a.vtt", vtt)] == [12, 14]
    assert [line.number for line in read(tmp_path, "a.vtt", VTT)] == [1, 2]  # names: their places
    named = TTML.format(extra="").replace("<p begin", '<p xml:id="c8" begin', 1)
    assert [line.number for line in read(tmp_path, "a.ttml", named)] == [8, 2]
    table = "line,in,out,speaker,words\n4,1,2,A,x\n6.0,3,4,A,y\n10.,5,6,A,z\n"
    assert [line.number for line in read(tmp_path, "a.csv", table)] == [4, 6, 10]
    for form in ("7.", "#7", "007"):
        found = read(tmp_path, "a.srt", SRT.replace("\n2\n", f"\n{form}\n"))
        assert [line.number for line in found] == [1, 7, 3]
    from_zero = SRT.replace("\n2\n", "\n1\n").replace("1\n", "0\n", 1).replace("\n3\n", "\n2\n")
    assert [line.number for line in read(tmp_path, "a.srt", from_zero)] == [0, 1, 2]


def test_speakers_of_one_cue_have_its_number(tmp_path: Path) -> None:
    """The recording of the last line is it_3.wav: it is the third cue."""
    cue = "00:0{}.000 --> 00:0{}.000\n{}\n\n"
    cues = [(1, 2, "Hello"), (3, 4, "<v Anna>Hi\n<v Ben>Yes"), (5, 6, "Bye")]
    vtt = "WEBVTT\n\n" + "".join(cue.format(*one) for one in cues)
    assert [line.number for line in read(tmp_path, "a.vtt", vtt)] == [1, 2, 2, 3]
    twice = vtt.replace("Bye", "- Bye\n- Bye, now")
    assert [line.number for line in read(tmp_path, "a.vtt", twice)] == [1, 2, 2, 3, 3]


@pytest.mark.parametrize("arrow", ["->", "\u2192", "\u2014>", "\u2013>"])
def test_arrows_of_word_processors(tmp_path: Path, arrow: str) -> None:
    assert read(tmp_path, "a.srt", SRT.replace("-->", arrow)) == read(tmp_path, "b.srt", SRT)


def test_tables_of_spreadsheets(tmp_path: Path) -> None:
    table = 'in;out;speaker;words\r\n1,5;2,5;ANNA;"Good\r\nevening"\r\n;;;\r\n'
    table += "3;4;BEN;Now\x0b!\r\n;;;\r\n"
    found = [
        (Fraction(3, 2), Fraction(5, 2), "ANNA", "Good evening"),
        (Fraction(3), Fraction(4), "BEN", "Now !"),
    ]
    assert rows(read(tmp_path, "a.csv", table)) == found
    assert rows(read(tmp_path, "a.tsv", table.replace(";", "\t"))) == found


def test_quotations_between_tabs_are_words(tmp_path: Path) -> None:
    """Where a spreadsheet writes them as they are, one may begin in a line and end in another."""
    table = "in\tout\tspeaker\twords\n1\t2\tANNA\t{}\n3\t4\tBEN\t{}\n"
    for words in (('"I went home,', 'and I left."'), ('"No" he said', "x"), ('"Never"', '"No')):
        found = read(tmp_path, "a.tsv", table.format(*words))
        assert [line.words for line in found] == [*words]
    excel = read(tmp_path, "a.tsv", table.format('"""No"" he said"', '"Good\nevening"'))
    assert [line.words for line in excel] == ['"No" he said', "Good evening"]


def test_a_row_of_ass_ends_with_its_line(tmp_path: Path) -> None:
    """Not at the signs that end lines elsewhere: what follows would be lost."""
    odd = ASS.replace("evening", "evening\u2028to\x85you")
    assert read(tmp_path, "a.ass", odd)[0].words == "Good, evening to you"


@pytest.mark.parametrize("end", ["\r\n", "\r", "\r\r\n"])
def test_ends_of_rows(tmp_path: Path, end: str) -> None:
    gap = SRT.replace("\n2\n", "\n7\n")
    (tmp_path / "b.srt").write_bytes(gap.replace("\n", end).encode())
    assert read_lines(tmp_path / "b.srt", FILM) == read(tmp_path, "a.srt", gap)


@pytest.mark.parametrize("first", [0, 5])
def test_every_row_may_be_followed_by_an_empty_one(tmp_path: Path, first: int) -> None:
    """As word processors paste it: recordings of lines are found by these numbers."""
    words = ("Hi", "How many?\n12", "Bye")
    cues = (
        f"{first + 2 * k}\n00:00:0{k},000 --> 00:00:0{k},500\n{text}\n\n"
        for k, text in enumerate(words)
    )
    text = "".join(cues)
    spaced = read(tmp_path, "a.srt", text.replace("\n", "\n\n"))
    assert spaced == read(tmp_path, "b.srt", text)
    assert [line.number for line in spaced] == [first, first + 2, first + 4]
    assert [line.words for line in spaced] == ["Hi", "How many? 12", "Bye"]


def test_a_number_among_cues_without_numbers_is_spoken(tmp_path: Path) -> None:
    vtt = "WEBVTT\n\n00:01.000 --> 00:02.000\nHow many?\n\n7\n\n00:03.000 --> 00:04.000\nBye\n"
    assert [line.words for line in read(tmp_path, "a.vtt", vtt)] == ["How many? 7", "Bye"]


ROLLING = """WEBVTT
Kind: captions

00:00:01.000 --> 00:00:02.390 align:start position:0%

hello<00:00:01.480><c> everybody</c>

00:00:02.390 --> 00:00:02.400 align:start position:0%
hello everybody


00:00:02.400 --> 00:00:04.030 align:start position:0%
hello everybody
no<00:00:02.800><c> no</c>

00:00:04.030 --> 00:00:04.040 align:start position:0%
no no


00:00:04.040 --> 00:00:05.000 align:start position:0%
no no


00:00:05.000 --> 00:00:06.000 align:start position:0%
no no
"""


def test_rolling_captions_say_each_row_once(tmp_path: Path) -> None:
    """YouTube shows a row again in a cue of 10 ms, and above the next row."""
    expected = [
        (Fraction(1), Fraction(239, 100), "", "hello everybody"),
        (Fraction(12, 5), Fraction(403, 100), "", "no no"),
        (Fraction(5), Fraction(6), "", "no no"),  # which is said twice
    ]
    assert rows(read(tmp_path, "a.vtt", ROLLING)) == expected
    srt = ROLLING.replace("WEBVTT\nKind: captions\n\n", "").replace(" align:start position:0%", "")
    assert rows(read(tmp_path, "a.srt", srt)) == expected


def test_words_that_are_numbers_stay(tmp_path: Path) -> None:
    text = "1\n00:00:01,000 --> 00:00:02,000\nIt was\n1984\n\n2\n00:00:03,000 --> 00:00:04,000\n7\n"
    assert [line.words for line in read(tmp_path, "a.srt", text)] == ["It was 1984", "7"]


@pytest.mark.parametrize("tag", ["<br>", "<br/>", "<BR />"])
def test_a_break_of_html_starts_a_row(tmp_path: Path, tag: str) -> None:
    text = SRT.replace("evening.\n", f"evening.{tag}")
    assert read(tmp_path, "a.srt", text)[0].words == "Good evening. And welcome."


def test_an_empty_row_in_a_cue_loses_no_words(tmp_path: Path) -> None:
    text = SRT.replace("evening.\n", "evening.\n\n")
    assert read(tmp_path, "a.srt", text)[0].words == "Good evening. And welcome."


def test_layers_of_one_line_may_be_a_hundredth_apart(tmp_path: Path) -> None:
    event = "Dialogue: {},0:00:03.0{},0:00:03.5{},Default,Anna,0,0,0,,Lala\n"
    lines = read(tmp_path, "a.ass", ASS + event.format(0, 0, 0) + event.format(1, 1, 1))
    assert [line.words for line in lines] == ["Good, evening", "Lala"]


def test_layers_drawings_and_arrows_of_ass(tmp_path: Path) -> None:
    event = "Dialogue: {},0:00:0{}.00,0:00:0{}.50,Default,{},0,0,0,,{}\n"
    text = ASS + "".join(
        event.format(*values)
        for values in (
            (0, 3, 3, "Anna", r"{\k20}La{\k30}la"),
            (1, 3, 3, "", r"{\blur3}Lala"),
            (0, 4, 4, "Anna", r"{\p1}m 0 0 l 100 0{\p0}"),
            (0, 5, 5, "Anna", r"{\p1}m 0 0 l 100 0{\p0}Words,\Ntoo"),
            (0, 6, 6, "Anna", "From A --> B"),
            (0, 7, 7, "Anna", "{unclosed"),
        )
    )
    assert [line.words for line in read(tmp_path, "a.ass", text)] == [
        "Good, evening",
        "Lala",
        "Words, too",
        "From A --> B",
        "{unclosed",
    ]
    other = "Format: Start, End, Text, Actor\nDialogue: 0:00:01.00,0:00:02.00,Hi,Ben\n"
    (line,) = read(tmp_path, "a.ass", "[Events]\n" + other)
    assert (line.speaker, line.words) == ("Ben", "Hi")
    with pytest.raises(ExplainedError, match="row 10: no times"):
        read(tmp_path, "a.ass", ASS + event.format(0, "x", 3, "Anna", "a"))


@pytest.mark.parametrize(
    ("after", "words"),
    [
        ("", "Evening"),
        (" align:start position:10%", "Evening"),
        (" X1:100 X2:200 Y1:5 Y2:9", "Evening"),
        (" Good", "Good Evening"),
        (" He said: good", "He said: good Evening"),
    ],
)
def test_words_beside_times_are_words(tmp_path: Path, after: str, words: str) -> None:
    text = f"1\n00:00:01,000 --> 00:00:02,000{after}\nEvening\n"
    (line,) = read(tmp_path, "a.srt", text)
    assert line.words == words


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("a.ttml", ('"24"', '"-24"')),
        ("a.ttml", ('"24"', '"1e99999999"')),
        ("a.ttml", ('"24"', '"1002"')),
        ("a.ttml", ("1000 1001", "1 0")),
        ("a.ttml", ("1000 1001", "1000 1001 7")),
        ("a.ttml", ('"1s"', '"-1s"')),
        ("a.ttml", ('"1s"', '"' + "9" * 50 + 's"')),
        ("a.csv", ("1.5, 0:02.5", "-1.5, 0:02.5")),
        ("a.csv", ("1.5, 0:02.5", "nan, 0:02.5")),
        ("a.csv", ("1.5, 0:02.5", "1.5, inf")),
        ("a.csv", ("1.5, 0:02.5", "1.5, 999:59:999999999")),
        ("a.srt", ("00:00:01,000", "-00:00:01,000")),
    ],
)
def test_times_are_bounded(tmp_path: Path, name: str, change: tuple[str, str]) -> None:
    text = {"a.ttml": TTML.format(extra=""), "a.csv": CSV, "a.srt": SRT}[name]
    assert change[0] in text
    with pytest.raises(ExplainedError):
        read(tmp_path, name, text.replace(*change, 1))


ROWS, MANY = 20_000, 300_000
HEAD = "1\n00:00:01,000 --> 00:00:02,000\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("dots.vtt", "WEBVTT\n\n00:01.000 --> 00:02.000\n<v" + "." * MANY),
        *(("signs.srt", HEAD + sign * MANY) for sign in '<{([>-:"&#.♪ '),
        *(
            ("pairs.srt", HEAD + sign * MANY)
            for sign in ("<v ", "<>", "{}", "(a) ", "A: ", "> ", ". A")
        ),
        ("rows.srt", HEAD + "\n" * ROWS + "x"),
        ("numbers.srt", HEAD + "1\n" * ROWS),
        ("arrows.srt", HEAD + "a --> b\n" * ROWS),
        ("braces.ass", ASS + "{" * MANY),
        ("overrides.ass", ASS + r"{\p1}" * MANY),
        ("headings.ass", "[" + "a" * MANY + "\n" + ASS),
        ("rate.ttml", TTML.format(extra="").replace('"24"', '"1e9999999"')),
        ("deep.ttml", TTML.format(extra="").replace("<div>", "<div>" * ROWS)),
        (
            "names.ttml",
            TTML.format(extra=f'xmlns:x="http://www.w3.org/{{ttml{"ttml" * ROWS}"').replace(
                "<br/>", "<x:br/>" * 1000
            ),
        ),
        ("cells.csv", "in,out,speaker,words\n1,2,A," + '"' * MANY),
    ],
)
def test_the_time_to_read_grows_with_the_length_alone(tmp_path: Path, name: str, text: str) -> None:
    """Each of these would take hours with a pattern that goes back and forth."""
    with contextlib.suppress(ExplainedError):
        read(tmp_path, name, text)
