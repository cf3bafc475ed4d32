"""Output at the end of commands: lines and tables. `live` shows the progress of work."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from dubbing.printable import visible

# `dfrf doctor` prints without the packages that these import.
if TYPE_CHECKING:
    from dubbing.batch.batch import Result
    from dubbing.cli.doctor.finding import Finding
    from dubbing.engine.graph.stage import Rate
    from dubbing.engine.planning.estimates import Estimate
    from dubbing.engine.planning.planner import Row
    from dubbing.identity.learned import Learned

COLOURS = {
    **dict.fromkeys(("made", "kept", "pass", "up to date", "fine"), "green"),
    **dict.fromkeys(("warn", "after", "slow", "unjudged", "not in this run"), "yellow"),
    **dict.fromkeys(("failed", "skipped", "stopped", "fail", "blocked", "lacking"), "red"),
}
out = Console(highlight=False, soft_wrap=True)


def line(console: Console, text: str, style: str | None = None) -> None:
    """Print a line without markup; control characters are written out."""
    console.print(visible(text), style=style, markup=False)


def _table(*columns: str) -> Table:
    return Table(*(Column(_cell(name)) for name in columns))


def _cell(text: str, style: str = "") -> Text:
    return Text(visible(text), style)


def summary(result: Result) -> None:
    """A line for every job that failed or was made, and where the report is."""
    for name, outcome in result.outcomes.items():
        seconds = sum(outcome.seconds.values())
        text = f"{name}: {outcome.state}" + (f" in {seconds:.0f} s" if seconds else "")
        if outcome.failure:
            text += f"; {outcome.failure}"
        line(out, text, COLOURS.get(outcome.state))
    for name, sync in result.syncs.items():
        text = f"{name}: sync {sync.get('verdict')}: {sync.get('reason')}"
        line(out, text, COLOURS.get(str(sync.get("verdict"))))
    for draft in result.drafts:
        line(out, f"draft: {draft}")
    written = [*(("timeline", one) for one in result.timelines), ("report", result.report)]
    for what, one in written:
        if isinstance(one, Exception):
            line(out, f"no {what}: {one}", "red")
        elif one is not None:
            line(out, f"{what}: {one}")


def result_line(result: Result) -> None:
    """The same as one line of JSON, the last of a run with --json."""
    failed = isinstance(result.report, Exception)
    outcomes = {name: asdict(outcome) for name, outcome in result.outcomes.items()}
    found = {"event": "result", "code": result.code, "jobs": outcomes, "syncs": result.syncs}
    report = None if failed or result.report is None else str(result.report)
    drafts = [str(path) for path in result.drafts]
    timelines = [str(one) for one in result.timelines if isinstance(one, Path)]
    found |= {"report": report, "drafts": drafts, "timelines": timelines}
    print(json.dumps(found), flush=True)


def plan(
    rows: Sequence[Row],
    warnings: Sequence[str],
    needed: Estimate,
    learned: Mapping[str, Learned],
    undubbed: Mapping[str, Sequence[dict[str, Any]]] | None = None,
    edits: Mapping[str, Sequence[dict[str, Any]]] | None = None,
    reach: Mapping[str, Sequence[dict[str, Any]]] | None = None,
    *,
    as_json: bool,
) -> None:
    """Print the stages that would run, why, their cost, and the seconds people were learned from.

    And by dub the lines of scripts that nobody dubs, those with edits, and how much of the others
    can be dubbed.
    """
    from dubbing.identity.learned import in_words

    if as_json:
        entries = [
            {"kind": row.job.kind, "name": row.job.name, "stage": row.name, "state": row.state}
            | {"reasons": row.reasons}
            for row in rows
        ]
        found = {"warnings": list(warnings), "stages": entries, "estimate": asdict(needed)}
        found |= {"learned": learned, "undubbed": undubbed or {}, "edits": edits or {}}
        found |= {"reach": reach or {}}
        print(json.dumps(found, indent=2))
        return
    table = _table("job", "stage", "state", "why")
    for row in rows:
        state = _cell(row.state, COLOURS.get(row.state, "default"))
        name = _cell(f"{row.job.kind} {row.job.name}")
        table.add_row(name, row.name, state, _cell("; ".join(row.reasons)))
    for warning in warnings:
        line(out, f"warning: {warning}", "yellow")
    out.print(table)
    for dub, lines in (undubbed or {}).items():
        for left in lines:
            who = f"{left['speaker']}: " if left["speaker"] else ""
            what = f"line {left['line']} at {left['in']}, {who}{left['words']}"
            line(out, f"{dub}: nobody dubs {what} ({left['why']})", "yellow")
    for dub, lines in (edits or {}).items():
        for one in lines:
            line(out, f"{dub}, line {one['line']} at {one['in']}: edited: {one['edit']}")
    for dub, lines in (reach or {}).items():
        for one in lines:
            text = f"{dub}, line {one['line']} at {one['in']}: {one['reach']}"
            line(out, text, "yellow" if one["short"] else None)
    for person, clips in learned.items():
        line(out, f"{person}: {in_words(clips)}")
    runs = sum(row.state == "run" for row in rows)
    kept = sum(row.state == "up to date" for row in rows)
    out.print(f"{runs} to run, {kept} up to date, {len(rows) - runs - kept} wait or are blocked")
    if len(rows) > kept:
        _needed(needed)


def _needed(needed: Estimate) -> None:
    if needed.seconds:
        out.print(
            f"about {duration(needed.seconds)}; {duration(needed.two)} with --jobs 2; "
            f"no less than {duration(needed.longest)} on any number of machines"
        )
    if needed.seconds and needed.elsewhere:
        out.print("some are times of another machine: dfrf doctor --calibrate measures this one's")
    out.print(
        f"about {needed.disk / 1e9:.1f} GB on the disk, {needed.memory / 1e9:.1f} GB of memory "
        "for each process"
    )


def duration(seconds: float) -> str:
    """In words: ``40 s``, ``25 min``, ``3.5 h``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def sync(found: dict[str, Any]) -> None:
    """The lip-sync figures of one video."""
    line(out, f"{found['verdict']}: {found['reason']}", COLOURS.get(found["verdict"]))
    if found["offset_frames"] is None:
        return
    out.print(f"offset {found['offset_frames']} frames, {found['offset_ms']:.0f} ms", end="")
    out.print(f" ({found['words']})" if found.get("words") else "")
    out.print(f"confidence {found['confidence']:.3f}, distance {found['distance']:.3f}")
    if parts := found.get("parts"):
        shares = (f"{part} {100 * share:.0f} %" for part, share in parts.items())
        out.print(f"as in the film: {', '.join(shares)}")


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
    """Print the findings of `doctor`."""
    table = _table("what", "state", "found")
    for finding in findings:
        state = _cell(finding.state, COLOURS.get(finding.state, "default"))
        table.add_row(finding.what, state, _cell(finding.found))
    out.print(table)
    # Below, so that a command is whole however narrow the terminal is; each once.
    for remedy in dict.fromkeys(finding.remedy for finding in findings if finding.remedy):
        out.print(visible(f"to do: {remedy}"), markup=False, soft_wrap=True)


def rates(found: dict[str, Rate], file: Path) -> None:
    """How fast this machine is at each stage."""
    table = _table("stage", "seconds for each frame, step or second of speech")
    for name, rate in found.items():
        table.add_row(name, f"{rate.seconds:.3f}")
    out.print(table)
    line(out, f"wrote {file}, which dfrf plan reads")


def _figure(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3f}" if isinstance(value, float) else "" if value is None else str(value)
