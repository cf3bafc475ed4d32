"""Tables of lip curves: read again as they were written, and everything that is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import ExplainedError
from dubbing.face.mouth.lip_curves import COLUMNS, LENGTHS, LipCurves, text_of

TIMES = np.array([0.02, 0.06, 0.1, 0.14])
OPENING, WIDTH = LENGTHS.index("opening"), LENGTHS.index("width")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "it.curves.csv"


def read(table: Path, text: str, line: int = 1) -> LipCurves:
    table.write_text(text)
    return LipCurves.read(table, line)


def test_what_is_written_is_read_again(table: Path) -> None:
    values = np.random.default_rng(0).random((4, 8)).round(4)
    rows = [(1, k, TIMES[k], values[k]) for k in range(4)] + [(3, 60, 0.02, values[0])]
    text = text_of(rows)
    assert text.splitlines()[0] == ",".join(COLUMNS)
    found = read(table, text)
    np.testing.assert_allclose(found.times, TIMES)
    np.testing.assert_allclose(found.at(TIMES), values)
    np.testing.assert_allclose(read(table, text, 3).values, values[:1])


@pytest.mark.parametrize(("sign", "point"), [(";", ","), (";", "."), ("\t", ","), ("\t", ".")])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_spreadsheets_save_it_otherwise(table: Path, sign: str, point: str, encoding: str) -> None:
    rows = [(1, k, TIMES[k], np.full(8, 0.25)) for k in range(4)]
    text = text_of(rows).replace(",", sign).replace(".", point)
    table.write_text(text + sign * (len(COLUMNS) - 1) + "\n", encoding=encoding)
    found = LipCurves.read(table, 1)
    np.testing.assert_allclose(found.times, TIMES)
    np.testing.assert_allclose(found.values, 0.25)


def test_between_rows_lies_the_middle_and_beside_them_nothing(table: Path) -> None:
    found = read(table, "time,opening\n0.1,0.2\n0.2,0.4\n0.3,\n0.4,0.6\n")
    opening = found.at(np.array([0.09, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.41]))[:, OPENING]
    wanted = [np.nan, 0.2, 0.3, 0.4, np.nan, np.nan, np.nan, 0.6, np.nan]
    np.testing.assert_allclose(opening, wanted)
    assert np.isnan(found.at(np.array([0.15]))[:, WIDTH]).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no column time"),
        ("frame,opening\n1,0.1\n", "no column time"),
        ("time,openning\n0,0.1\n", "unknown column 'openning'"),
        ("time,opening\n0,wide\n", "row 2, opening: must be a number of 0 to 2, not 'wide'"),
        ("time,opening\n0,0.1\n0.1,-0.1\n", "row 3, opening: must be a number of 0 to 2"),
        ("time,opening\n0,2.5\n", "row 2, opening: must be a number of 0 to 2, not '2.5'"),
        ("time,opening\n0,inf\n", "row 2, opening"),
        ("time,closure\n0,1.5\n", "row 2, closure: must be a number of 0 to 1, not '1.5'"),
        ("time,opening\n,0.1\n", "row 2, time: must be a number"),
        ("time,opening\nnan,0.1\n", "row 2, time: must be a number"),
        ("time,opening\n0.1,0.1\n0.1,0.2\n", "the times of line 1 do not rise at 0.1 s"),
        ("line,time\n3,0.1\n", "has no row of line 1"),
        ("time,opening,,\n0.1,0.1,5,6\n", "unknown column ''"),
        ("time,opening\n0.1,0.1,7\n", "row 2: more cells than columns"),
    ],
)
def test_other_tables_are_refused(table: Path, text: str, words: str) -> None:
    with pytest.raises(ExplainedError) as caught:
        read(table, text)
    assert words in str(caught.value)
    assert "it.curves.csv" in str(caught.value)
