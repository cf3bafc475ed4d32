"""Files of a scene's lines, which other programs open."""

import csv

import pytest

from dubbing.report.lines import as_csv


@pytest.mark.parametrize(
    "words",
    ['=HYPERLINK("x")', "+1 555", "-- Yes.", "@SUM(1)", " =1", "\t=1", "＝1", "－1", "|calc", "%1"],
)
def test_no_cell_is_a_formula(words: str) -> None:
    rows = [{"line": 3, "offset_ms": -40.0, "gain": None, "words": words, "speaker": words}]
    (found,) = csv.DictReader(as_csv(rows).splitlines())
    assert found["words"] == found["speaker"] == f"'{words}"
    assert (found["line"], found["offset_ms"], found["gain"]) == ("3", "-40.0", "")


def test_ordinary_words_are_written_as_they_are() -> None:
    (found,) = csv.DictReader(as_csv([{"words": 'Yes, "he" - said = so'}]).splitlines())
    assert found["words"] == 'Yes, "he" - said = so'
