"""Parts of a stage, by each of the three executors: the same bytes, and none is done twice."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from dubbing.engine.disk import claims
from dubbing.engine.graph.graph import nodes
from dubbing.engine.graph.part import Part
from dubbing.engine.running import runner
from dubbing.engine.running.executors import Executor, InLine
from dubbing.engine.running.outcome import Outcome
from dubbing.engine.running.runner import Options
from dubbing.engine.running.update import run_stage
from tests.dubbing.engine.listener import Listener
from tests.dubbing.engine.small_graph import (
    PARTS,
    Render,
    begun,
    jobs_of,
    results,
    steps,
    write_manifest,
)

pytestmark = pytest.mark.medium


Make = Callable[[Path], Executor]


def run(path: Path, executor: Executor, force: tuple[str, ...] = ()) -> dict[str, Outcome]:
    return runner.run(jobs_of(path), Options(force), Listener(), executor)


def whole(folder: Path, name: str = "it") -> dict[str, str]:
    """What the graph comes to in line and without parts."""
    folder.mkdir()
    path = write_manifest(folder, ["ann"], {name: "ann"})
    run(path, InLine())
    return results(path)


def test_parts_give_the_same_bytes_and_in_line_there_are_none(
    tmp_path: Path, executor: Make, kind: str
) -> None:
    path = write_manifest(tmp_path, ["ann"], {"it": "ann"}, PARTS)
    outcomes = run(path, executor(path))
    assert {outcome.state for outcome in outcomes.values()} == {"made"}
    assert set(outcomes["dub/it"].seconds) == {"listen", "render"}  # a part counts as its stage
    assert results(path) == whole(tmp_path / "whole")
    rendered = [line for line in begun(path) if "render" in line]
    done = [line for line in steps(path) if "render" in line]
    if kind == "in line":
        assert rendered == ["it/render"]
        return
    assert sorted(rendered) == ["it/render", "it/render 0-1", "it/render 2-3"]
    assert rendered[-1] == "it/render"
    of = ["it/render 0-1 0", "it/render 0-1 1", "it/render 2-3 2", "it/render 2-3 3"]
    assert sorted(done) == [*sorted(["it/render 4", *of])]
    render = jobs_of(path).by_label["dub/it"].stage(Render)
    record = render.record()
    assert record is not None
    assert record["seconds"] >= 0
    # A second run has nothing to do; one that is forced does the stage in one go.
    assert {o.state for o in run(path, executor(path)).values()} == {"kept"}
    run(path, executor(path), force=("render",))
    assert [line for line in begun(path) if "render" in line] == [*rendered, "it/render"]


@pytest.mark.parametrize("kind", ["processes", "dask"], indirect=True)
def test_a_part_that_is_killed_costs_itself_alone(tmp_path: Path, executor: Make) -> None:
    path = write_manifest(tmp_path, ["ann"], {"killed_once": "ann"}, PARTS)
    assert run(path, executor(path))["dub/killed_once"].state == "made"
    count = Counter(line for line in begun(path) if "render" in line)
    assert count == {
        "killed_once/render": 1,
        "killed_once/render 0-1": 2,
        "killed_once/render 2-3": 1,
    }
    assert (
        max(Counter(line.rpartition(" ")[2] for line in steps(path) if "render" in line).values())
        == 1
    )
    assert results(path) == whole(tmp_path / "whole", "killed_once")


@pytest.mark.parametrize("kind", ["processes"], indirect=True)
def test_a_part_that_fails_fails_its_dub_and_the_others_are_not_done_again(
    tmp_path: Path, executor: Make
) -> None:
    path = write_manifest(tmp_path, ["ann"], {"bad_it": "ann"}, PARTS)
    outcome = run(path, executor(path))["dub/bad_it"]
    assert outcome.failure is not None
    assert (outcome.state, outcome.failure.stage, outcome.failure.what) == (
        "failed",
        "render",
        "cannot",
    )
    assert "bad_it/render" not in begun(path)
    run(path, executor(path))
    count = Counter(line for line in begun(path) if "render" in line)
    assert count == {"bad_it/render 0-1": 2, "bad_it/render 2-3": 1}
    # In line the rest is done in one go, and the seconds of all of it are kept.
    run(path, InLine())
    record = jobs_of(path).by_label["dub/bad_it"].stage(Render).record()
    assert record is not None
    assert not any("part" in name for name in record["outputs"])


def test_whoever_claims_a_stage_waits_for_its_parts_and_they_leave_it_alone(tmp_path: Path) -> None:
    path = write_manifest(tmp_path, ["ann"], {"it": "ann"}, PARTS)
    jobs = jobs_of(path)
    for node in nodes(jobs).values():
        if not isinstance(node.stage, Render):
            run_stage(node.stage, lambda message, share: None)
    render = jobs.by_label["dub/it"].stage(Render)
    part = Part.of(render, PARTS[0])
    with claims.hold(render.folder):
        assert not run_stage(part, lambda message, share: None)
    with claims.hold(part.folder) as claim:
        began = time.monotonic()
        threading.Timer(0.5, claim.release).start()
        assert run_stage(render, lambda message, share: None)
        assert time.monotonic() - began >= 0.5
    assert not run_stage(part, lambda message, share: None)  # its stage is up to date
