"""What the commands print: bars on a terminal, one line a stage in a log, tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Column, Table
from rich.text import Text
from tqdm import tqdm

from dubbing.printable import visible

# `dfrf doctor` prints without the packages that these import.
if TYPE_CHECKING:
    from dubbing.batch import Result
    from dubbing.cli.doctor import Finding
    from dubbing.engine.graph import Job
    from dubbing.engine.planner import Row
    from dubbing.engine.runner import Failure
    from dubbing.engine.stage import Stage

COLOURS = {
    **dict.fromkeys(("made", "kept", "pass", "up to date", "fine"), "green"),
    **dict.fromkeys(("warn", "after", "slow", "unjudged", "not in this run"), "yellow"),
    **dict.fromkeys(("failed", "skipped", "stopped", "fail", "blocked", "lacking"), "red"),
}
out = Console(highlight=False, soft_wrap=True)
screen = Console(stderr=True, highlight=False)


def _bar(title: str) -> tqdm:
    """A bar of 100 %; nothing where there is no terminal."""
    shown = "{desc} {bar:24} {percentage:3.0f} % {elapsed}{postfix}"
    off = not screen.is_terminal
    return tqdm(
        total=1.0, desc=visible(title), bar_format=shown, leave=False, disable=off, file=screen.file
    )


def _advance(bar: tqdm, message: str, share: float) -> None:
    bar.set_postfix_str(visible(message), refresh=False)
    bar.update(share - bar.n)


def _line(console: Console, text: str, style: str | None = None) -> None:
    """A line that says what it holds: no markup, no orders to the terminal."""
    console.print(visible(text), style=style, markup=False)


def _table(*columns: str) -> Table:
    return Table(*(Column(_cell(name)) for name in columns))


def _cell(text: str, style: str = "") -> Text:
    return Text(visible(text), style)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar, as a progress function."""
    with _bar(title) as bar:
        yield partial(_advance, bar)


class Bars:
    """Tells on stderr how a run goes on; see `Reporter` of the runner."""

    def __init__(self, warnings: Sequence[str]) -> None:
        self._bars: dict[Path, tqdm] = {}  # by the folder of the stage
        for warning in warnings:
            _line(screen, f"warning: {warning}", "yellow")

    def __enter__(self) -> Bars:
        return self

    def __exit__(self, *_: object) -> None:
        for bar in self._bars.values():
            bar.close()

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        """A stage starts."""
        title = f"{job.name}: {_named(job, stage)}"
        self._bars[stage.folder] = _bar(title)
        if not screen.is_terminal:
            _line(screen, f"{title} ({', '.join(reasons)})")

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        """A stage is ``share`` (0..1) done."""
        _advance(self._bars[stage.folder], message, share)

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        """A stage is done or has failed."""
        self._bars.pop(stage.folder).close()
        title = f"{job.name}: {_named(job, stage)}"
        with tqdm.external_write_mode(file=screen.file):  # a line above the bars of other stages
            if failure:
                _line(screen, f"{title} failed: {failure}", "red")
            elif screen.is_terminal:
                _line(screen, f"{title} done", "green")


def _named(job: Job, stage: Stage) -> str:
    """What a job calls a stage: its kind, and which one it is where there are several."""
    return next((name for name, own in job.stages.items() if own is stage), stage.name)


def summary(result: Result) -> None:
    """A line for every job that failed or was made, and where the report is."""
    for name, outcome in result.outcomes.items():
        seconds = sum(outcome.seconds.values())
        text = f"{name}: {outcome.state}" + (f" in {seconds:.0f} s" if seconds else "")
        if outcome.failure:
            text += f"; {outcome.failure}"
        _line(out, text, COLOURS.get(outcome.state))
    for name, sync in result.syncs.items():
        text = f"{name}: sync {sync.get('verdict')}: {sync.get('reason')}"
        _line(out, text, COLOURS.get(str(sync.get("verdict"))))
    failed = isinstance(result.report, Exception)
    said = f"no report: {result.report}" if failed else f"report: {result.report}"
    _line(out, said, "red" if failed else None)


def plan(rows: Sequence[Row], warnings: Sequence[str], *, as_json: bool) -> None:
    """What would run, and why."""
    if as_json:
        entries = [
            {
                "kind": row.job.kind,
                "name": row.job.name,
                "stage": row.stage,
                "state": row.state,
                "reasons": list(row.reasons),
            }
            for row in rows
        ]
        print(json.dumps({"warnings": list(warnings), "stages": entries}, indent=2))
        return
    table = _table("job", "stage", "state", "why")
    for row in rows:
        state = _cell(row.state, COLOURS.get(row.state, "default"))
        name = _cell(f"{row.job.kind} {row.job.name}")
        table.add_row(name, row.stage, state, _cell("; ".join(row.reasons)))
    for warning in warnings:
        _line(out, f"warning: {warning}", "yellow")
    out.print(table)
    runs = sum(row.state == "run" for row in rows)
    kept = sum(row.state == "up to date" for row in rows)
    out.print(f"{runs} to run, {kept} up to date, {len(rows) - runs - kept} wait or are blocked")


def sync(found: dict[str, Any]) -> None:
    """The lip-sync figures of one video."""
    _line(out, f"{found['verdict']}: {found['reason']}", COLOURS.get(found["verdict"]))
    if found["offset_frames"] is None:
        return
    out.print(f"offset {found['offset_frames']} frames, {found['offset_ms']:.0f} ms", end="")
    out.print(f" ({found['words']})" if found.get("words") else "")
    out.print(f"confidence {found['confidence']:.3f}, distance {found['distance']:.3f}")


def metrics(found: dict[str, dict[str, dict[str, Any]]]) -> None:
    """Held-out figures: identity -> method -> figure. A table a person, a column a method.

    Behind them the medians over the people, where there are several.
    """
    flat = {
        name: {method: one_level(row) for method, row in methods.items()}
        for name, methods in found.items()
    }
    tables = dict(flat)
    if len(flat) > 1:
        tables[f"median of {len(flat)}"] = medians(flat)
    for title, methods in tables.items():
        table = _table(title, *methods)
        # In the order in which they were measured.
        for name in dict.fromkeys(key for row in methods.values() for key in row):
            if not name.endswith("suspicion"):
                cells = [name, *(_figure(m.get(name)) for m in methods.values())]
                table.add_row(*map(_cell, cells))
        out.print(table)
    for identity, methods in flat.items():
        for method, row in methods.items():
            for name, why in row.items():
                if name.endswith("suspicion"):
                    protocol = name.removesuffix("suspicion")
                    text = f"{identity}, {method}: {protocol}{why}"
                    out.print(text, style="yellow", markup=False)


def one_level(row: dict[str, Any]) -> dict[str, Any]:
    """Figures of one method with those of P15x among them, named after it."""
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, dict):
            flat |= {f"{name} {inner}": figure for inner, figure in value.items()}
        else:
            flat[name] = value
    return flat


def medians(found: dict[str, dict[str, dict[str, Any]]]) -> dict[str, dict[str, float]]:
    """method -> figure -> its median over the people who have it. Only numbers have one."""
    values: dict[str, dict[str, list[float]]] = {}
    for methods in found.values():
        for method, row in methods.items():
            of_method = values.setdefault(method, {})
            for name, value in row.items():
                if isinstance(value, int | float) and not isinstance(value, bool):
                    of_method.setdefault(name, []).append(float(value))
    return {
        method: {name: median(numbers) for name, numbers in row.items()}
        for method, row in values.items()
    }


def doctor(findings: Sequence[Finding]) -> None:
    """What the machine has and lacks."""
    table = _table("what", "state", "found", "what to do")
    for finding in findings:
        state = _cell(finding.state, COLOURS.get(finding.state, "default"))
        table.add_row(finding.what, state, _cell(finding.found), _cell(finding.remedy))
    out.print(table)


def _figure(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3f}" if isinstance(value, float) else "" if value is None else str(value)
