"""How work goes on: a live table on a terminal, one line a stage in a log, JSON for machines."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
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
    layout = "{desc} {bar:24} {percentage:3.0f} % {elapsed}, left {remaining}{postfix}"
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


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar, as a progress function."""
    with _bar(title) as bar:
        yield partial(_advance, bar)


class Bars:
    """A row for each stage that is made now, wherever that is; see `Reporter` of the runner."""

    def __init__(self, warnings: Sequence[str]) -> None:
        self._bars: dict[Path, tqdm] = {}  # by the folder of the stage
        self._overall: tqdm | None = None
        for warning in warnings:
            line(screen, f"warning: {warning}", "yellow")

    def __enter__(self) -> Bars:
        return self

    def __exit__(self, *_: object) -> None:
        for bar in (*self._bars.values(), *filter(None, [self._overall])):
            bar.close()

    def overall(self, done: int, total: int) -> None:
        if self._overall is None:
            self._overall = _bar("all stages")
        _advance(self._overall, f"{done} of {total}", done / total)

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        title = f"{job.name}: {job.name_of(stage)}"
        self._bars[stage.folder] = _bar(title)
        if not screen.is_terminal:
            line(screen, f"{title} ({', '.join(reasons)})")

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        _advance(self._bars[stage.folder], message, share)

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        self._bars.pop(stage.folder).close()
        title = f"{job.name}: {job.name_of(stage)}"
        with tqdm.external_write_mode(file=screen.file):  # a line above the bars of other stages
            if failure:
                line(screen, f"{title} failed: {failure}", "red")
            elif screen.is_terminal:
                line(screen, f"{title} done", "green")


class JsonLines:
    """A line of JSON on stdout for all that happens; of progress, one a second for each stage."""

    def __init__(self, warnings: Sequence[str]) -> None:
        self._last: dict[Path, float] = {}  # by the folder of the stage
        self._warnings = warnings

    def __enter__(self) -> JsonLines:
        for warning in self._warnings:
            _event("warning", text=warning)
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left open."""

    def overall(self, done: int, total: int) -> None:
        _event("overall", done=done, total=total)

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        _event("begin", job=job.label, stage=job.name_of(stage), reasons=reasons)

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        now = time.monotonic()
        if now - self._last.get(stage.folder, 0.0) >= 1.0:
            self._last[stage.folder] = now
            name = job.name_of(stage)
            _event("progress", job=job.label, stage=name, message=message, share=share)

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        why = asdict(failure) if failure else None
        _event("end", job=job.label, stage=job.name_of(stage), failure=why)


def _event(kind: str, **found: Any) -> None:
    print(json.dumps({"event": kind, **found}), flush=True)
