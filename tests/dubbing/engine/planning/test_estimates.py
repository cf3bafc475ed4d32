"""Time, disk and memory of a run, from records of stages that are done."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import pytest

from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.graph import Job, Jobs, nodes
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.engine.graph.stage_id import StageId
from dubbing.engine.planning import estimates, planner
from dubbing.engine.planning.estimates import Estimate
from dubbing.engine.running import runner
from dubbing.engine.running.runner import Options
from dubbing.engine.running.update import run_stage
from tests.dubbing.engine.listener import Listener
from tests.dubbing.engine.small_graph import PARTS, jobs_of, write_manifest

KINDS = ("prepare", "check_source", "finetune", "listen", "render")
MADE = b"ten bytes."


class Early(Stage):
    """Is never done."""


@dataclass(frozen=True, kw_only=True)
class Copy(Stage):
    """Reads a file and a stage."""

    typical: ClassVar[Rate] = Rate(3.0, 2.0)

    text: Path
    before: Stage = field(default_factory=Early)
    seed: int = 0
    code: Setting[str] = "1"
    many: Setting[float] = 5.0
    slow: Setting[bool] = False

    def run(self, out: Path, progress: Progress) -> None:
        (out / "made.txt").write_bytes(MADE)

    def amount(self) -> float:
        return self.many

    def rate_kind(self) -> str:
        return f"{self.kind} slow" if self.slow else self.kind

    @property
    def version(self) -> str:
        return self.code


@pytest.fixture
def job(tmp_path: Path) -> Job:
    """A job with one stage that is done: 5 units in 8 seconds."""
    (tmp_path / "text.txt").write_text("abc")
    made = Job("copy", "one", tmp_path / "one")
    done(made.add(Copy(text=tmp_path / "text.txt")), 8.0)
    return made


def done(stage: Stage, seconds: float) -> None:
    """Do a stage, as if it had taken so long."""
    run_stage(stage, lambda message, share: None)
    file = stage.folder / "stage.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "seconds": seconds}))


def measured(*jobs: Job) -> dict[str, Rate]:
    return estimates.measured(nodes(Jobs.of(jobs)))


def test_a_record_of_the_same_files_and_parameters_is_a_measure(job: Job) -> None:
    assert measured(job) == {"copy": Rate(8 / 5, len(MADE) / 5)}
    # Code and results of earlier stages change how long nothing takes.
    job.add(replace(job.stage(Copy), code="2"))
    assert measured(job)["copy"].seconds == 8 / 5
    before = Copy(folder=job.folder / "before", text=job.stage(Copy).text)
    done(before, 1.0)
    other = replace(job.stage(Copy), code="1", before=before)
    assert other.changes() == ["before changed"]
    job.add(other)
    assert measured(job)["copy"].seconds == 8 / 5


def test_of_other_parameters_it_is_none(job: Job) -> None:
    job.add(replace(job.stage(Copy), seed=1))
    assert measured(job) == {}


def test_of_another_file_it_is_none(job: Job) -> None:
    text = job.stage(Copy).text
    moved = text.rename(text.with_name("moved.txt"))
    job.add(replace(job.stage(Copy), text=moved))
    assert "copy" in measured(job)
    moved.write_text("other")
    assert measured(job) == {}


def test_nor_of_a_stage_that_is_no_work_or_not_done(job: Job) -> None:
    job.add(replace(job.stage(Copy), many=0.0))
    assert measured(job) == {}
    assert measured(Job("copy", "none", Path())) == {}


def test_rates_are_medians_by_their_names(job: Job, tmp_path: Path) -> None:
    others = []
    for name, seconds, slow in (("two", 1.0, False), ("three", 99.0, False), ("four", 50.0, True)):
        other = Job("copy", name, tmp_path / name)
        done(other.add(Copy(text=job.stage(Copy).text, slow=slow)), seconds)
        others.append(other)
    found = measured(job, *others)
    assert {name: rate.seconds for name, rate in found.items()} == {"copy": 1.6, "copy slow": 10.0}


def test_what_is_measured_goes_before_what_is_known_and_that_before_the_typical(
    job: Job, tmp_path: Path
) -> None:
    other = Job("copy", "two", tmp_path / "two")
    stage = other.add(Copy(text=job.stage(Copy).text))

    def seconds(known: dict[str, Rate], *jobs: Job) -> float:
        return estimates.expected(Jobs.of(jobs), known, parts=False)[stage.id]

    assert seconds({"copy": Rate(2.0)}, job, other) == 8.0
    assert seconds({"copy": Rate(2.0)}, other) == 10.0
    assert seconds({}, other) == 15.0


def test_parts_take_the_time_of_their_stage(tmp_path: Path) -> None:
    path = write_manifest(tmp_path, ["ann"], {"it": "ann"}, PARTS)
    known = {"render": Rate(2.0), "finetune": Rate(4.0)}
    whole, in_parts = (
        estimates.expected(jobs_of(path), known, parts=parts) for parts in (False, True)
    )
    render = StageId("dub/it", "render")
    assert whole[render] == 10.0
    assert {name.part: s for name, s in in_parts.items() if name.whole == render} == {
        "0-1": 4.0,
        "2-3": 4.0,
    }
    others = {name: seconds for name, seconds in whole.items() if name != render}
    assert others == {name: s for name, s in in_parts.items() if name.whole != render}
    assert whole[StageId("identity/ann", "finetune")] == 20.0


def needed(path: Path) -> Estimate:
    jobs = jobs_of(path)
    return estimates.estimate(jobs, planner.rows(jobs), dict.fromkeys(KINDS, Rate(1.0, 10.0)))


@pytest.mark.parametrize("parts", [(), PARTS])
def test_needs_of_a_run(tmp_path: Path, parts: tuple[str, ...]) -> None:
    """Five steps a stage: prepare and check_source, then finetune; listen; then render."""
    found = needed(write_manifest(tmp_path, ["ann"], {"it": "ann"}, parts))
    render, first_half = (4.0, 2.0) if parts else (5.0, 5.0)
    assert found == Estimate(
        seconds=20.0 + render,
        two=10.0 + first_half,  # listen beside finetune, parts beside one another
        longest=10.0 + first_half,
        disk=10 * (20.0 + render),
        memory=1e6,
    )


def test_a_time_that_nobody_measured_here_is_said_to_be_elsewheres(tmp_path: Path) -> None:
    path = write_manifest(tmp_path, ["ann"], {"it": "ann"})
    jobs = jobs_of(path)
    some = dict.fromkeys(set(KINDS) - {"render"}, Rate(1.0, 10.0))
    assert estimates.estimate(jobs, planner.rows(jobs), some).elsewhere
    assert not needed(path).elsewhere


def test_what_is_done_needs_nothing_and_one_process_the_most_of_what_is_left(
    tmp_path: Path,
) -> None:
    path = write_manifest(tmp_path, ["ann"])
    runner.run(jobs_of(path), Options(), Listener())
    assert needed(path) == Estimate(0.0, 0.0, 0.0, 0.0, 0.0)
    path = write_manifest(tmp_path, ["ann"], {"it": "ann"})
    found = needed(path)
    assert found.memory == 1e3
    assert found.disk > 0
    assert found.seconds == found.two == found.longest == 10.0
