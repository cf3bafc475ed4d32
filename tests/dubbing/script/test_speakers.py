"""Whose a line is: the ways in which scripts name a speaker, and words that name nobody."""

from __future__ import annotations

import unicodedata
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from dubbing.script.line import Line
from dubbing.script.reading import read_lines

RATE = Fraction(25)
ALBA = "Álba"


def srt(*texts: str) -> str:
    return "".join(
        f"{k + 1}\n00:00:{2 * k:02d},000 --> 00:00:{2 * k + 1:02d},000\n{text}\n\n"
        for k, text in enumerate(texts)
    )


def read(folder: Path, text: str, *names: str, kind: str = "srt") -> list[Line]:
    path = folder / f"a.{kind}"
    path.write_text(text, encoding="utf-8")
    return read_lines(path, RATE, names)


def said(lines: list[Line]) -> list[tuple[str, str]]:
    return [(line.speaker, line.words) for line in lines]


@pytest.mark.parametrize(
    "text",
    [
        "ALBA: Hi there.",
        "ALBA : Hi there.",
        "ALBA:Hi there.",
        "ALBA|Hi there.",
        "alba: Hi there.",
        "Alba: Hi there.",
        "ALBA (V.O.): Hi there.",
        "ALBA (V.O.)\nHi there.",
        "ALBA (V.O.) Hi there.",
        "ALBA (CONT’D):\nHi there.",
        "ALBA (whispering): Hi there.",
        "ALBA, off: Hi there.",
        "ALBA V.O.: Hi there.",
        "ALBA\nHi there.",
        ">> ALBA: Hi there.",
        ">>ALBA: Hi there.",
        "&gt;&gt; ALBA: Hi there.",
        ">>> ALBA: Hi there.",
        "- ALBA: Hi there.",
        "– ALBA: Hi there.",
        "-ALBA: Hi there.",
        "ALBA：Hi there.",
        "[ALBA] Hi there.",
        "[ALBA]: Hi there.",
        "[ALBA:] Hi there.",
        "[Alba]\nHi there.",
        "(ALBA) Hi there.",
        "【ALBA】Hi there.",
        "<v ALBA>Hi there.",
        "<v.loud Alba>Hi there.</v>",
        "<b>ALBA:</b> Hi there.",
        "{\\an8}ALBA: Hi there.",
        "ALBA - Hi there.",
        "ALBA — Hi there.",
        "ALBA –\nHi there.",
        "ALBA. — Hi there.",
        "ALBA:\u00a0Hi there.",
        '<font face="Monospace">{\\an7}\\h\\hALBA:\\hHi there.\\h</font>',
        "\u200eALBA: Hi there.",
        "(laughs) ALBA: Hi there.",
        "ALBA: Hi\nthere.",
        "- ALBA: Hi\n- ALBA: there.",
    ],
)
def test_common_ways_to_name_a_speaker(tmp_path: Path, text: str) -> None:
    assert said(read(tmp_path, srt(text), "ALBA")) == [("ALBA", "Hi there.")]
    assert said(read(tmp_path, "WEBVTT\n\n" + srt(text).replace(",", "."), "ALBA", kind="vtt")) == [
        ("ALBA", "Hi there.")
    ]


def test_a_bar_after_a_speakers_number_is_no_clock(tmp_path: Path) -> None:
    text = srt("SPEAKER_00|Yes.", "SPEAKER_01|2 of them.")
    names = ("SPEAKER_00", "SPEAKER_01")
    expected = [("SPEAKER_00", "Yes."), ("SPEAKER_01", "2 of them.")]
    assert said(read(tmp_path, text, *names)) == expected
    path = tmp_path / "b.srt"
    path.write_text(text)
    assert said(read_lines(path, RATE, None)) == expected  # as `dfrf init` guesses them


@pytest.mark.parametrize("form", ["NFC", "NFD"])
@pytest.mark.parametrize("name", [ALBA, ALBA.upper(), "ALBA"])
def test_accents_are_written_in_several_ways(tmp_path: Path, form: Any, name: str) -> None:
    text = unicodedata.normalize(form, srt(f"{name}: Hi."))
    other: Any = {"NFC": "NFD", "NFD": "NFC"}[form]
    known = unicodedata.normalize(other, ALBA)
    assert said(read(tmp_path, text, known)) == [(known, "Hi.")]


def test_names_that_are_alike_are_told_apart(tmp_path: Path) -> None:
    lines = read(tmp_path, srt("Ann: One.", "ANN: Two.", "ann: Three."), "Ann", "ANN")
    assert said(lines)[:2] == [("Ann", "One."), ("ANN", "Two.")]
    assert not lines[2].speaker  # one of both: nobody knows


@pytest.mark.parametrize(
    "words",
    [
        "Remember: be kind.",
        "At 10:30 it begins.",
        "He said: go!",
        "Then I told Bob: go!",
        "Well - no.",
        "Alba and Bob went home.",
        "I am (off) today.",
        "Alba, come here!",
        "Alba!\nCome here!",
        "Alba",
        "a < b, and b > c",
        "From A --> B",
        "10 --> 20",
    ],
)
def test_ordinary_words_stay_words(tmp_path: Path, words: str) -> None:
    (line,) = read(tmp_path, srt(words), "ALBA")
    assert (line.speaker, line.words) == ("", " ".join(words.split()))
    (line,) = read(tmp_path, srt(f"ALBA: {words}"), "ALBA")
    assert (line.speaker, line.words) == ("ALBA", " ".join(words.split()))


def test_a_name_that_stands_only_where_the_speaker_changes(tmp_path: Path) -> None:
    text = srt("ALBA: One.", "Two.", "BOB: Three.", "Four.", "ALBA: Five.", "(laughs)", "Six.")
    lines = read(tmp_path, text, "ALBA")
    assert [line.speaker for line in lines] == ["ALBA", "ALBA", "BOB", "BOB", "ALBA", "", "ALBA"]
    assert [line.number for line in lines if line.carried] == [2, 4, 7]
    # Of a script that names one person, the others may be anybody's.
    assert [line.speaker for line in read(tmp_path, srt("ALBA: One.", "Two."), "ALBA")] == [
        "ALBA",
        "",
    ]


def test_who_spoke_last_is_a_matter_of_times_not_of_the_files_order(tmp_path: Path) -> None:
    one, two, three = srt("ALBA: One.", "Two.", "BOB: Three.").split("\n\n")[:3]
    lines = read(tmp_path, "\n\n".join((one, three, two)), "ALBA")
    assert [(line.number, line.speaker) for line in lines] == [(1, "ALBA"), (2, "ALBA"), (3, "BOB")]


@pytest.mark.parametrize(
    ("text", "whose"),
    [
        ("[Alba, in Spanish] Two.", "ALBA"),
        ("(ALBA, ON PHONE): Two.", "ALBA"),
        ("[Alba, on radio]\nTwo.", "ALBA"),
        ("[Alba, Bob] Two.", ""),
        ("Alba, come here: Two.", ""),
    ],
)
def test_an_addition_to_a_name_in_a_bracket(tmp_path: Path, text: str, whose: str) -> None:
    line = read(tmp_path, srt("BOB: One.", text, "ALBA: Three."), "ALBA", "BOB")[1]
    assert (line.speaker == "ALBA" and not line.carried) == bool(whose)
    assert line.words == ("Two." if whose else text)


@pytest.mark.parametrize(("begin", "whose"), [("00,800", ""), ("00,990", "ALBA")])
def test_what_stands_beside_a_line_is_not_its_speakers(
    tmp_path: Path, begin: str, whose: str
) -> None:
    """As a sign that is read while somebody speaks; the next line may be theirs again."""
    text = srt("ALBA: One.", "PLATFORM 4", "Three.", "BOB: Four.")
    text = text.replace("00:00:02,000", f"00:00:{begin}")
    lines = read(tmp_path, text, "ALBA", "BOB")
    assert [line.speaker for line in lines] == ["ALBA", whose, "ALBA", "BOB"]


def test_nobody_is_assigned_where_names_are_a_field(tmp_path: Path) -> None:
    path = tmp_path / "a.ass"
    event = "Dialogue: 0,0:00:0{0}.00,0:00:0{0}.50,Default,{1},0,0,0,,Hi {0}\n"
    said = enumerate(("ALBA", "BOB", ""), 1)
    path.write_text("[Events]\n" + "".join(event.format(*one) for one in said))
    last = read_lines(path, Fraction(25), ["ALBA", "BOB"])[2]
    assert (last.speaker, last.carried) == ("", False)


@pytest.mark.parametrize(
    "text",
    [
        "Ben: Two.",
        ">> Two.",
        "- Two.",
        "Alba and Ben: Two.",
        "小明：Two.",
        "ALBA & BOB: Two.",
        "♪ Two ♪",
    ],
)
def test_strange_names_and_dashes_are_not_the_last_speakers(tmp_path: Path, text: str) -> None:
    lines = read(tmp_path, srt("BOB: Zero.", "ALBA: One.", text), "ALBA", "BOB")
    assert lines[2].speaker not in ("ALBA", "BOB")
    assert not lines[2].carried


@pytest.mark.parametrize(
    ("text", "spoken"),
    [
        ("MR. SMITH: Hi.", [("Mr. Smith", "Hi.")]),
        ("- MR. SMITH (V.O.): Hi.", [("Mr. Smith", "Hi.")]),
        ("J. R. EWING: Hi.", [("J. R. Ewing", "Hi.")]),
        ("DR. NO: Hi.", [("DR. NO", "Hi.")]),
        ("J. R. EWING: Hi. MR. SMITH: No.", [("J. R. Ewing", "Hi."), ("Mr. Smith", "No.")]),
        ("No. MR. SMITH: Hi.", [("", "No."), ("Mr. Smith", "Hi.")]),
        ("No. J. R. Ewing: Hi.", [("", "No."), ("J. R. Ewing", "Hi.")]),
    ],
)
def test_a_title_before_a_name_is_no_sentence(
    tmp_path: Path, text: str, spoken: list[tuple[str, str]]
) -> None:
    assert said(read(tmp_path, srt(text), "Mr. Smith", "J. R. Ewing")) == spoken


def test_a_line_after_a_long_pause_is_not_the_last_speakers(tmp_path: Path) -> None:
    text = srt("BOB: Zero.", "ALBA: One.") + "3\n00:00:30,000 --> 00:00:31,000\nTwo.\n"
    assert [line.speaker for line in read(tmp_path, text, "ALBA")] == ["BOB", "ALBA", ""]


@pytest.mark.parametrize(
    ("text", "whose"),
    [
        ("- ALBA: Hi.\n- BOB: Hello.", ["ALBA", "BOB"]),
        ("ALBA: Hi.\nBOB: Hello.", ["ALBA", "BOB"]),
        ("ALBA: Hi. BOB: Hello.", ["ALBA", "BOB"]),
        ("ALBA: Hi. - Bob: Hello.", ["ALBA", "BOB"]),
        (">> ALBA: Hi. >> BOB: Hello.", ["ALBA", "BOB"]),
        ("<v ALBA>Hi.</v>\n<v BOB>Hello.</v>", ["ALBA", "BOB"]),
        ("ALBA: Hi.\n- Hello.", ["ALBA", ""]),
        ("- Hi.\n- Hello.", ["", ""]),
        ("- Hi.\n- BOB: Hello.", ["", "BOB"]),
    ],
)
def test_several_speakers_in_one_cue(tmp_path: Path, text: str, whose: list[str]) -> None:
    lines = read(tmp_path, srt("BOB: Before.", text), "ALBA", "BOB")[1:]
    assert said(lines) == list(zip(whose, ["Hi.", "Hello."], strict=True))
    assert [(line.number, line.shared, line.carried) for line in lines] == [(2, True, False)] * 2
