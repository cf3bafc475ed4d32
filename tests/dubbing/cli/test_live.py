"""In a log there is a sign of life every `QUIET` seconds, however long a step takes."""

from __future__ import annotations

import io
import json
import threading
from pathlib import Path

import pytest
from rich.console import Console

from dubbing.cli import live
from dubbing.engine.graph.graph import Job
from dubbing.engine.graph.stage import Stage
from dubbing.engine.graph.stage_id import StageId
from dubbing.engine.planning.time_left import TimeLeft


class Finetune(Stage):
    """Does nothing."""


JOB = Job("identity", "ann", Path("ann"))
STAGE = JOB.add(Finetune())
LEFT = {STAGE.id: 400.0, StageId("dub/it", "render"): 80.0}


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> Console:
    console = Console(file=io.StringIO(), width=200, force_terminal=False)
    monkeypatch.setattr(live, "screen", console)
    return console


def written(console: Console) -> list[str]:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_it_says_how_far_each_stage_is_and_what_is_left(log: Console) -> None:
    now = 0.0
    with live.Bars([], TimeLeft(LEFT, lambda: now)) as bars:
        bars.overall(0, 2)
        bars.begin(JOB, STAGE, ["not made yet"])
        bars.progress(JOB, STAGE, "step 500 of 1000", 0.5)
        now = 200.0
        bars.say()
        bars.end(JOB, STAGE, None)
        bars.say()  # nothing goes on
    begun, alive = written(log)
    assert begun == "ann: finetune (not made yet)"
    assert alive == "ann: finetune: 50% step 500 of 1000; 0 of 2 stages, left 5 min"


def test_a_step_that_reports_nothing_is_seen_to_go_on(
    log: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "QUIET", 0.01)
    said = threading.Event()
    monkeypatch.setattr(live.Bars, "say", lambda self: said.set())
    with live.Bars([]) as bars:
        bars.begin(JOB, STAGE, [])
        assert said.wait(60)
        bars.end(JOB, STAGE, None)
    assert not bars._pulse._thread.is_alive()


def test_so_are_commands_of_one_bar(log: Console, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "QUIET", 0.01)
    said = threading.Event()
    monkeypatch.setattr(live, "line", lambda *_: said.set())
    with live.progress_bar("prepare"):
        assert said.wait(60)


def test_machines_are_told_which_stages_go_on(capsys: pytest.CaptureFixture[str]) -> None:
    now = 0.0
    with live.JsonLines([], TimeLeft(LEFT, lambda: now)) as lines:
        lines.begin(JOB, STAGE, [])
        lines.say()
        lines.end(JOB, STAGE, None)
        lines.say()
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    (alive,) = [event for event in events if event["event"] == "alive"]
    assert alive["stages"] == ["identity/ann/finetune"]
    assert alive["left"] == 480.0
