"""What the commands print fits on a terminal."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from dubbing.batch import batch
from dubbing.cli import console, live
from dubbing.engine.graph.graph import Job
from dubbing.engine.graph.stage import Stage
from dubbing.engine.planning.estimates import Estimate
from dubbing.engine.planning.planner import Row
from dubbing.engine.running.outcome import Failure, Outcome
from dubbing.errors import ExplainedError

ODD = "[bold]a[/x] \x1b[31m"
SHOWN = r"[bold]a[/x] \x1b[31m"

NOTHING = Estimate(0.0, 0.0, 0.0, 0.0, 0.0)
FIGURES = dict.fromkeys(("psnr", "ssim", "haarpsi", "psnr_face", "psnr_mouth", "lmd"), 0.5)


class Listen(Stage):
    """Does nothing."""


def test_figures_of_several_methods_are_readable_in_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.out, "_width", 80)
    methods = dict.fromkeys(("dfrf", "dfrf-nowarp", "ad-nerf", "nerf"), FIGURES)
    console.metrics({"bob": {**methods, "dfrf": {**FIGURES, "lpips": 0.25, "frames": 7}}})
    shown = capsys.readouterr().out
    assert "…" not in shown
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.splitlines()]
    assert ["psnr_mouth", "0.500", "0.500", "0.500", "0.500"] in rows
    assert ["lpips", "0.250", "", "", ""] in rows
    assert ["frames", "7", "", "", ""] in rows


def test_markup_and_controls_in_names_are_shown_as_they_are(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.out, "_width", 200)
    job = Job("dub", ODD, Path())
    row = Row(job, job.add(Listen()), "run", (f"{ODD} changed",))
    line = {"line": 1, "in": ODD, "reach": "all", "short": False}
    console.plan([row], [ODD], NOTHING, {}, reach={ODD: [line]}, as_json=False)
    console.metrics({ODD: {ODD: {ODD: 1.0}}})
    measured = {"offset_frames": 0, "offset_ms": 0.0, "confidence": 1.0, "distance": 1.0}
    console.sync({"verdict": "pass", "reason": ODD, **measured})
    failed = Outcome("failed", failure=Failure("listen", ODD))
    result = batch.Result({ODD: failed}, 1, ExplainedError(ODD), {ODD: {"reason": ODD}})
    console.summary(result)
    shown = capsys.readouterr().out
    assert "\x1b[31m" not in shown
    assert shown.count(SHOWN) == 14


def test_times_of_another_machine_are_said_to_be_that(capsys: pytest.CaptureFixture[str]) -> None:
    job = Job("dub", "it", Path())
    row = Row(job, job.add(Listen()), "run", ())
    for elsewhere in (True, False):
        needed = replace(NOTHING, seconds=40.0, elsewhere=elsewhere)
        console.plan([row], [], needed, {}, as_json=False)
        assert ("another machine" in capsys.readouterr().out) == elsewhere


def test_markup_and_controls_in_what_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Console(file=io.StringIO(), width=200, force_terminal=True)
    monkeypatch.setattr(live, "screen", terminal)
    job = Job("dub", ODD, Path())
    stage = job.add(Listen())
    with live.Bars([ODD]) as bars:
        bars.begin(job, stage, [ODD])
        bars.progress(job, stage, ODD, 0.5)
        bars._bars[stage.folder].refresh()
        bars.end(job, stage, Failure("listen", ODD))
    with live.progress_bar(ODD) as progress:
        progress(ODD, 0.5)
    assert isinstance(terminal.file, io.StringIO)
    message = terminal.file.getvalue()
    assert SHOWN in message
    assert f" 50 % 00:00, left 00:00, {SHOWN}" in message
    assert "a[/x] \x1b[31m" not in message


def rows_of(shown: str) -> list[list[str]]:
    """Cells of the tables that were printed."""
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.splitlines()]


def test_medians_over_people_and_what_is_suspicious(capsys: pytest.CaptureFixture[str]) -> None:
    def person(opening: float, **more: object) -> dict[str, dict[str, object]]:
        return {"dfrf": {"psnr": 30.0, **more, "p15x": {"opening_r": opening}}}

    why = "sync confidence 0.300 is above the source's own 0.200"
    console.metrics(
        {
            "ann": person(0.25),
            "bob": person(0.75, suspicious=True, suspicion=why, lag_ms=10.0),
            "eve": person(0.5, suspicious=False),
        }
    )
    shown = capsys.readouterr().out
    rows = rows_of(shown)
    assert [row for row in rows if row[:1] == ["p15x opening_r"]] == [
        ["p15x opening_r", figure] for figure in ("0.250", "0.750", "0.500", "0.500")
    ]
    assert ["suspicious", "yes"] in rows
    # A median is of those who have the figure, and of numbers only.
    behind = shown[shown.index("median of 3") :]
    assert ["lag_ms", "10.000"] in rows_of(behind)
    assert "suspicious" not in behind
    assert f"bob, dfrf: {why}" in shown
