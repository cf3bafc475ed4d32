"""How work goes on: a live table on a terminal, one line a stage in a log, JSON for machines."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from tqdm import tqdm

from dubbing.cli.console import duration, line
from dubbing.engine.graph.stage import Progress
from dubbing.engine.planning.time_left import TimeLeft
from dubbing.printable import visible

if TYPE_CHECKING:
    from dubbing.engine.graph.graph import Job
    from dubbing.engine.graph.stage import Stage
    from dubbing.engine.graph.stage_id import StageId
    from dubbing.engine.running.outcome import Failure

QUIET = 30.0  # seconds without a line in a log, at most
REFRESHED = 1.0  # seconds in which bars are drawn anew
screen = Console(stderr=True, highlight=False)


def _bar(title: str, left: str = "") -> tqdm:
    """A bar of 100 %; nothing where there is no terminal."""
    layout = f"{{desc}} {{bar:24}} {{percentage:3.0f}} % {{elapsed}}{left}{{postfix}}"
    off = not screen.is_terminal
    return tqdm(
        total=1.0,
        desc=visible(title),
        bar_format=layout,
        leave=False,
        disable=off,
        file=screen.file,
    )


def _advance(bar: tqdm, message: str, share: float) -> None:
    bar.set_postfix_str(visible(message), refresh=False)
    bar.update(share - bar.n)


class Pulse:
    """A thread that gives a sign of life every so many seconds, however long one step takes."""

    def __init__(self, say: Callable[[], None], seconds: float) -> None:
        self._say, self._seconds, self._end = say, seconds, threading.Event()
        self._thread = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> Pulse:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _beat(self) -> None:
        while not self._end.wait(self._seconds):
            self._say()


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """A bar, as a progress function; in a log, a line every `QUIET` seconds."""
    last = ("", 0.0)
    with _bar(title, ", left {remaining}") as bar:

        def advance(message: str, share: float) -> None:
            nonlocal last
            last = (message, share)
            _advance(bar, message, share)

        def say() -> None:
            line(screen, f"{title}: {last[1]:.0%} {last[0]}")

        with Pulse(bar.refresh, REFRESHED) if screen.is_terminal else Pulse(say, QUIET):
            yield advance


class Bars:
    """A row for each stage that is made now, wherever that is; see `Reporter` of the runner.

    In a log, a line when a stage begins, and one every `QUIET` seconds while it goes on.

    Args:
        left: what is known of how long the run takes.
    """

    def __init__(self, warnings: Sequence[str], left: TimeLeft | None = None) -> None:
        self._left = left or TimeLeft({}, time.monotonic)
        self._bars: dict[Path, tqdm] = {}  # by the folder of the stage
        self._said: dict[Path, str] = {}  # how far it is
        self._overall: tqdm | None = None
        self._counted = ""
        terminal = screen.is_terminal
        self._pulse = Pulse(self.refresh, REFRESHED) if terminal else Pulse(self.say, QUIET)
        for warning in warnings:
            line(screen, f"warning: {warning}", "yellow")

    def __enter__(self) -> Bars:
        self._pulse.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._pulse.__exit__()
        for bar in (*self._bars.values(), *filter(None, [self._overall])):
            bar.close()

    def refresh(self) -> None:
        """Draw what is known anew: time passes where nothing is reported, too."""
        for bar in [*self._bars.values()]:
            bar.refresh()
        if self._overall is not None:
            text = f"{self._counted}{_left(self._left.all())}"
            self._overall.set_postfix_str(text, refresh=True)

    def say(self) -> None:
        """A line for each stage that goes on."""
        for text in [*self._said.values()]:
            line(screen, f"{text}; {self._counted}{_left(self._left.all())}")

    def overall(self, done: int, total: int) -> None:
        self._counted = f"{done} of {total} stages"
        if self._overall is None:
            self._overall = _bar("all stages")
        left = "" if done == total else _left(self._left.all())
        _advance(self._overall, f"{self._counted}{left}", done / total)

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        title = f"{job.name}: {stage.id.name}"
        self._left.begin(stage.id)
        self._bars[stage.folder], self._said[stage.folder] = _bar(title), title
        if not screen.is_terminal:
            line(screen, f"{title} ({', '.join(reasons)})")

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        key = stage.id
        self._left.progress(key, share)
        self._said[stage.folder] = f"{job.name}: {stage.id.name}: {share:.0%} {message}"
        left = self._left.of(key)
        text = message if left is None else f"left {tqdm.format_interval(left)}, {message}"
        _advance(self._bars[stage.folder], text, share)

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        self._left.end(stage.id)
        self._bars.pop(stage.folder).close()
        del self._said[stage.folder]
        title = f"{job.name}: {stage.id.name}"
        with tqdm.external_write_mode(file=screen.file):  # a line above the bars of other stages
            if failure:
                line(screen, f"{title} failed: {failure}", "red")
            elif screen.is_terminal:
                line(screen, f"{title} done", "green")


class JsonLines:
    """A line of JSON on stdout for all that happens; of progress, one a second for each stage.

    While nothing is heard of a stage, one every `QUIET` seconds, with the seconds that are left.
    """

    def __init__(self, warnings: Sequence[str], left: TimeLeft | None = None) -> None:
        self._last: dict[Path, float] = {}  # by the folder of the stage
        self._warnings = warnings
        self._left = left or TimeLeft({}, time.monotonic)
        self._running: list[StageId] = []
        self._pulse = Pulse(self.say, QUIET)

    def __enter__(self) -> JsonLines:
        for warning in self._warnings:
            _event("warning", text=warning)
        self._pulse.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._pulse.__exit__()

    def say(self) -> None:
        """The stages that are running."""
        if self._running:
            _event("alive", stages=[*map(str, self._running)], left=self._left.all())

    def overall(self, done: int, total: int) -> None:
        _event("overall", done=done, total=total)

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        self._left.begin(stage.id)
        self._running.append(stage.id)
        _event("begin", job=job.label, stage=stage.id.name, reasons=reasons)

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        self._left.progress(stage.id, share)
        now = time.monotonic()
        if now - self._last.get(stage.folder, 0.0) >= 1.0:
            self._last[stage.folder] = now
            name = stage.id.name
            _event("progress", job=job.label, stage=name, message=message, share=share)

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        self._left.end(stage.id)
        self._running.remove(stage.id)
        why = asdict(failure) if failure else None
        _event("end", job=job.label, stage=stage.id.name, failure=why)


def _left(seconds: float | None) -> str:
    return "" if seconds is None else f", left {duration(seconds)}"


def _event(kind: str, **found: Any) -> None:
    print(json.dumps({"event": kind, **found}), flush=True)
