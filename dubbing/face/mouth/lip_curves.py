"""Curves of the lips as a table: a row a frame, a column a length in eye distances, or closures.

F frames, N rows, C = 8 curves: the seven lengths of `lip_measures` in their order, and how far
lips of these lengths are closed, 0..1.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.engine.disk.files import read_text
from dubbing.errors import ExplainedError

LENGTHS = ("opening", "opening_right", "opening_left", "width", "lower_lip", "upper_lip", "chin")
UNIT = "(eye distances)"
LINE, FRAME, TIME = "line", "frame", "time (s)"
CLOSURE = "closure"
COLUMNS = (LINE, FRAME, TIME, *(f"{name} {UNIT}" for name in LENGTHS), CLOSURE)
DELIMITERS = ",;\t"  # spreadsheets write semicolons where a comma is the decimal sign
MOST_BYTES = 50 * 10**6
LONGEST = 2.0  # eye distances: no mouth is larger
MOST = [*((name, LONGEST) for name in LENGTHS), (CLOSURE, 1.0)]
DIGITS = 4


@dataclass(frozen=True)
class LipCurves:
    """Curves of one line's lips over the seconds of its sound.

    Attributes:
        times: (N,) rising. values: (N, C), NaN where none is given.
    """

    times: np.ndarray
    values: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """Values (F, C) at times (F,): between two rows in between, NaN beside them.

        NaN also where one of the two rows has none.
        """
        after = np.searchsorted(self.times, times).clip(1, max(1, len(self.times) - 1))
        before, after = after - 1, after.clip(max=len(self.times) - 1)
        low, high = self.times[before], self.times[after]
        share = ((times - low) / np.where(high > low, high - low, 1))[:, None]
        first, last = self.values[before], self.values[after]
        found = first * (1 - share) + last * share
        found = np.where(
            np.abs(share) < 1e-6, first, np.where(np.abs(share - 1) < 1e-6, last, found)
        )
        outside = (times < self.times[0] - 1e-6) | (times > self.times[-1] + 1e-6)
        return np.where(outside[:, None], np.nan, found)

    @staticmethod
    def read(path: Path, line: int) -> LipCurves:
        """Those of a line in a file; a file without a column of lines is of one line.

        Raises:
            ExplainedError: the file holds something else, or nothing of that line.
        """
        rows = [row for row in _rows(path) if row[0] in (None, line)]
        if not rows:
            raise ExplainedError(f"has no row of line {line}", path.name)
        times = np.array([time for _, time, _ in rows])
        if (np.diff(times) <= 0).any():
            late = times[1:][np.diff(times) <= 0][0]
            raise ExplainedError(f"the times of line {line} do not rise at {late:g} s", path.name)
        return LipCurves(times, np.array([values for _, _, values in rows]))


def text_of(rows: Iterable[tuple[int, int, float, np.ndarray]]) -> str:
    """A table of rows: line, frame of the dub, seconds of the line's sound, values (C,)."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(COLUMNS)
    for line, frame, time, values in rows:
        given = [f"{one:.{DIGITS}f}" for one in values]
        table.writerow([line, frame, f"{time:.{DIGITS}f}", *given])
    return out.getvalue()


def _rows(path: Path) -> list[tuple[int | None, float, list[float]]]:
    """Line, time and values of every row."""
    try:
        text = read_text(path, MOST_BYTES)
        sign = max(DELIMITERS, key=text.partition("\n")[0].count)
        table = csv.DictReader(io.StringIO(text), delimiter=sign)
        names = {name: (name or "").partition("(")[0].strip() for name in table.fieldnames or ()}
        read = list(table)
    except (OSError, ValueError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ExplainedError(f"cannot be read as CSV: {reason}", path.name) from error
    known = {name.partition("(")[0].strip() for name in COLUMNS}
    unknown = [name for name in names.values() if name not in known]
    if unknown or "time" not in names.values():
        what = f"unknown column {unknown[0]!r:.60}" if unknown else "no column time"
        raise ExplainedError(what, path.name, f"there may be {', '.join(sorted(known))}")
    rows = []
    for number, cells in enumerate(read, 2):
        if not any(cells.values()):
            continue  # spreadsheets write empty rows below a table
        if None in cells:
            raise ExplainedError(f"row {number}: more cells than columns", path.name)
        row = {names[key]: cell for key, cell in cells.items()}
        line = _number(row.get(LINE), path, number, LINE, 1e9) if row.get(LINE) else None
        time = _number(row["time"], path, number, "time", 1e9)
        values = [_number(row.get(name) or "nan", path, number, name, most) for name, most in MOST]
        rows.append((None if line is None else round(line), time, values))
    return rows


def _number(cell: str | None, path: Path, row: int, column: str, most: float) -> float:
    try:
        value = float((cell or "").replace(",", "."))
    except ValueError:
        value = math.inf
    empty = cell == "nan" and column not in (LINE, "time")
    if not empty and not 0 <= value <= most:
        what = f"row {row}, {column}: must be a number of 0 to {most:g}, not {cell!r:.40}"
        raise ExplainedError(what, path.name)
    return value
