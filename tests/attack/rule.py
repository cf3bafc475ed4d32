"""The one rule of the attack.

Whatever a call of `dfrf` is handed, it ends with a documented exit code; where that is not 0, it
says what, where and what to do in a sentence, without a traceback; and it writes to `output` alone.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import signal
import sys
import traceback
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from dubbing.cli import main as cli

CODES = (0, 1, 2, 3)
MOST_SECONDS = 60  # of processor time, so that a busy machine fails nothing
OUTPUT = "out"  # of every manifest here
WHERE = re.compile(r"\(.+?\)|line \d+|/|--|'")  # a place, a line, a path, an option, an argument
# What the report and the summary say of an error that nobody expected.
BUGS = ("Traceback (most recent call last)", "not foreseen", "please report")


@dataclass(frozen=True)
class Ending:
    """How a call ended: its exit code, what it printed, and what escaped it."""

    code: object
    out: str
    err: str
    escaped: str = ""


@dataclass
class Tally:
    """How many cases of each kind there were, and the ways in which the rule was broken."""

    cases: Counter[str] = field(default_factory=Counter)
    codes: dict[str, Counter[object]] = field(default_factory=dict)
    broken: dict[str, set[str]] = field(default_factory=dict)

    def add(self, kind: str, ending: Ending, why: list[str]) -> None:
        """Count a case."""
        self.cases[kind] += 1
        self.codes.setdefault(kind, Counter())[ending.code] += 1
        self.broken.setdefault(kind, set()).update(re.sub(r"\d+", "#", text) for text in why)

    def table(self) -> Iterator[str]:
        """Lines: a kind, its cases, its exit codes, in how many ways it was outside the rule."""
        yield f"{'kind':34} {'cases':>7}  {'outside':>7}  exit codes"
        for kind, cases in sorted(self.cases.items()):
            ends = sorted(self.codes[kind].items(), key=str)
            codes = ", ".join(f"{code}: {count}" for code, count in ends)
            yield f"{kind:34} {cases:7}  {len(self.broken[kind]):7}  {codes}"
        outside = sum(map(len, self.broken.values()))
        yield f"{'all':34} {self.cases.total():7}  {outside:7}"
        for kind, ways in sorted(self.broken.items()):
            yield from (f"outside the rule: {kind}: {way}" for way in sorted(ways))


TALLY = Tally()


class TookTooLongError(BaseException):
    """More than `MOST_SECONDS`; no handler of the tool takes it for an error of its own."""


def call(*arguments: object) -> Ending:
    """Run the command line in this process."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    before, words = signal.getsignal(signal.SIGTERM), sys.argv
    code: object = 0
    escaped = ""
    sys.argv = ["dfrf", *map(str, arguments)]
    try:
        with redirect_stdout(out), redirect_stderr(err), _time_limit():
            cli.main()
    except SystemExit as end:
        code = end.code or 0
        if code == cli.INTERRUPTED:  # by who runs the tests
            raise KeyboardInterrupt from end
    except (Exception, TookTooLongError):
        code, escaped = None, traceback.format_exc()
    finally:
        signal.signal(signal.SIGTERM, before)
        sys.argv = words
    return Ending(code, _text_of(out), _text_of(err), escaped)


def judge(kind: str, room: Path, *arguments: object, reads_only: bool = False) -> Ending:
    """Run a call in a room, hold it to the rule, count it.

    Args:
        room: the folder with everything that the call may read; `room/out` may be written to.
        reads_only: not even that.

    Raises:
        AssertionError: the rule is broken.
    """
    before = contents(room, reads_only)
    ending = call(*arguments)
    why = list(offences(ending))
    if (after := contents(room, reads_only)) != before:
        changed = sorted(map(str, {n for n, _ in before.items() ^ after.items()}))
        why.append(f"wrote outside of the output: {changed}")
    TALLY.add(kind, ending, why)
    assert not why, f"{why}\n{ending.escaped}{ending.err}{ending.out}"
    return ending


def offences(ending: Ending) -> Iterator[str]:
    """In what an ending breaks the rule."""
    text = ending.err + ending.out
    if ending.escaped:
        yield ending.escaped.strip().splitlines()[-1][:200]
        return
    if ending.code not in CODES:
        yield f"exit code {ending.code!r}"
    for bug in BUGS:
        if bug in text:
            line = next(line for line in text.splitlines() if bug in line)
            yield f"speaks of a bug: {line[:300]}"
    if ending.code == 2 and not WHERE.search(ending.err):
        yield f"names no place: {ending.err[:200]}"
    if ending.code in (1, 2) and not text.strip():
        yield "says nothing"
    if orders := {c for c in text if unicodedata.category(c) in ("Cc", "Cs") and c not in "\n\t"}:
        yield f"control characters are printed: {sorted(orders)}"


def contents(room: Path, with_output: bool) -> dict[str, str]:
    """Digests of what lies in a room by its name; without what the output holds."""
    found = {}
    for folder, folders, files in os.walk(os.fsencode(room)):
        if not with_output and os.path.abspath(folder) == os.fsencode(room):
            folders[:] = [name for name in folders if name != OUTPUT.encode()]
        for name in (*folders, *files):
            path = os.path.join(folder, name)
            found[os.fsdecode(path)] = _digest(path)
    return found


def _digest(path: bytes) -> str:
    if os.path.islink(path):
        return f"to {os.readlink(path)!r}"
    if not os.path.isfile(path):
        return "no file"
    with open(path, "rb") as stream:
        return hashlib.blake2b(stream.read(), digest_size=16).hexdigest()


def _text_of(stream: io.TextIOWrapper) -> str:
    stream.flush()
    written = stream.buffer
    assert isinstance(written, io.BytesIO)
    return written.getvalue().decode(errors="surrogateescape")


@contextmanager
def _time_limit() -> Iterator[None]:
    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise TookTooLongError(f"over {MOST_SECONDS} s of processor time")

    before: Callable[..., Any] | int | None = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
