"""How work goes on: a live table on a terminal, one line a stage in a log, JSON for machines."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from rich.console import Console
from tqdm import tqdm

from dubbing.cli.console import line
from dubbing.printable import visible

if TYPE_CHECKING:
    from dubbing.engine.graph import Job
    from dubbing.engine.outcome import Failure
    from dubbing.engine.stage import Stage

screen = Console(stderr=True, highlight=False)


def _bar(title: str) -> tqdm:
    """A bar of 100 %; nothing where there is no terminal."""
    shown = "{desc} {bar:24} {percentage:3.0f} % {elapsed}, left {remaining}{postfix}"
    off = not screen.is_terminal
    return tqdm(
        total=1.0, desc=visible(title), bar_format=shown, leave=False, disable=off, file=screen.file
    )


def _advance(bar: tqdm, message: str, share: float) -> None:
    bar.set_postfix_str(visible(message), refresh=False)
    bar.update(share - bar.n)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar, as a progress function."""
    with _bar(title) as bar:
        yield partial(_advance, bar)


class Bars:
    """A row for each stage that is made now, wherever that is; see `Reporter` of the runner."""

    def __init__(self, warnings: Sequence[str]) -> None:
        self._bars: dict[tuple[str, str], tqdm] = {}
        for warning in warnings:
            line(screen, f"warning: {warning}", "yellow")

    def __enter__(self) -> Bars:
        return self

    def __exit__(self, *_: object) -> None:
        for bar in self._bars.values():
            bar.close()

    def overall(self, done: int, total: int) -> None:
        """So many of all stages are done."""
        if ("", "") not in self._bars:
            self._bars["", ""] = _bar("all stages")
        _advance(self._bars["", ""], f"{done} of {total}", done / total)

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        """A stage starts."""
        title = f"{job.name}: {stage.name}"
        self._bars[job.label, stage.name] = _bar(title)
        if not screen.is_terminal:
            line(screen, f"{title} ({', '.join(reasons)})")

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        """A stage is ``share`` (0..1) done."""
        _advance(self._bars[job.label, stage.name], message, share)

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        """A stage is done or has failed."""
        self._bars.pop((job.label, stage.name)).close()
        with tqdm.external_write_mode(file=screen.file):  # a line above the bars of other stages
            if failure:
                line(screen, f"{job.name}: {stage.name} failed: {failure}", "red")
            elif screen.is_terminal:
                line(screen, f"{job.name}: {stage.name} done", "green")


class JsonLines:
    """A line of JSON on stdout for all that happens; of progress, one a second for each stage."""

    def __init__(self, warnings: Sequence[str]) -> None:
        self._last: dict[tuple[str, str], float] = {}
        self._warnings = warnings

    def __enter__(self) -> JsonLines:
        for warning in self._warnings:
            _event("warning", text=warning)
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left open."""

    def overall(self, done: int, total: int) -> None:
        """So many of all stages are done."""
        _event("overall", done=done, total=total)

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        """A stage starts."""
        _event("begin", job=job.label, stage=stage.name, reasons=reasons)

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        """A stage is ``share`` (0..1) done."""
        now = time.monotonic()
        if now - self._last.get((job.label, stage.name), 0.0) >= 1.0:
            self._last[job.label, stage.name] = now
            _event("progress", job=job.label, stage=stage.name, message=message, share=share)

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        """A stage is done or has failed."""
        why = asdict(failure) if failure else None
        _event("end", job=job.label, stage=stage.name, failure=why)


def _event(kind: str, **found: Any) -> None:
    print(json.dumps({"event": kind, **found}), flush=True)
