"""A graph of stages, by each of the three executors."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import pytest

from dubbing.engine.disk import claims
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.graph import Job, Jobs, Node, nodes
from dubbing.engine.graph.stage import Progress, Stage
from dubbing.engine.running import runner
from dubbing.engine.running.executors import Executor, InLine, Program, Task
from dubbing.engine.running.outcome import Failure, Outcome
from dubbing.engine.running.processes import Processes
from dubbing.engine.running.runner import Options
from tests.dubbing.engine import small_graph
from tests.dubbing.engine.listener import Listener
from tests.dubbing.engine.small_graph import LOG, begun, jobs_of, program, results, write_manifest

pytestmark = pytest.mark.medium


Make = Callable[[Path], Executor]
PEOPLE = ["ann", "bob"]
DUBS = {"ann_it": "ann", "scene": "ann bob"}


def states(outcomes: dict[str, Outcome]) -> dict[str, str]:
    return {label.partition("/")[2]: outcome.state for label, outcome in outcomes.items()}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What the small graph comes to when nothing happens."""
    path = write_manifest(tmp_path_factory.mktemp("undisturbed"), PEOPLE, DUBS)
    runner.run(jobs_of(path), Options(), Listener())
    return results(path)


def test_the_executors_give_the_same_bytes_and_do_each_stage_once(
    tmp_path: Path, executor: Make, undisturbed: dict[str, str]
) -> None:
    path = write_manifest(tmp_path, PEOPLE, DUBS)
    listener = Listener()
    outcomes = runner.run(jobs_of(path), Options(), listener, executor(path))
    assert set(states(outcomes).values()) == {"made"}
    assert results(path) == undisturbed
    assert "claim" not in str(list(undisturbed))
    order = begun(path)
    assert sorted(order) == sorted(name_of(node) for node in graph(path))
    assert "scene/render bob" in order
    for node in graph(path):
        for needed in (n for n in graph(path) if n.stage.id in node.needs):
            assert order.index(name_of(needed)) < order.index(name_of(node))
    kinds = [name.partition(" ")[0].replace("/", ":") for name in order]
    assert sorted(listener.began) == sorted(kinds)
    assert set(outcomes["dub/scene"].seconds) == {"listen", "render", "composite"}
    # A second run has nothing to do.
    again = runner.run(jobs_of(path), Options(), listener, executor(path))
    assert (set(states(again).values()), begun(path)) == ({"kept"}, order)


def graph(path: Path) -> list[Node]:
    return list(nodes(jobs_of(path)).values())


def name_of(node: Node) -> str:
    """The stage as the log has it."""
    return f"{node.job.name}/{node.stage.id.name}"


def test_one_that_fails_stops_only_what_needs_it(tmp_path: Path, executor: Make) -> None:
    dubs = {"bad_it": "bad", "scene": "ann bad"}
    path = write_manifest(tmp_path, ["ann", "bad", "worse"], dubs)
    outcomes = runner.run(jobs_of(path), Options(), Listener(), executor(path))
    assert states(outcomes) == {
        "ann": "made",
        "bad": "failed",
        "worse": "failed",
        "bad_it": "skipped",
        "scene": "skipped",
    }
    failure = outcomes["identity/bad"].failure
    assert failure is not None
    assert (failure.what, failure.where, failure.remedy) == ("cannot", "bad.mp4", "do this")
    assert failure.trace == ""
    skipped = outcomes["dub/bad_it"].failure
    assert skipped is not None
    assert skipped.what == "identity bad failed: cannot"
    unforeseen = outcomes["identity/worse"].failure
    assert unforeseen is not None
    assert "nobody thought of this" in unforeseen.trace
    assert begun(path).count("bad/prepare") == 1  # a clear error is not tried again
    assert "bad/finetune" not in begun(path)
    # What of a scene does not go back to it is made.
    assert "scene/render ann" in begun(path)
    assert not {"scene/render bad", "scene/composite"} & {*begun(path)}


def test_each_that_needs_a_stage_of_a_job_says_why_that_one_failed(tmp_path: Path) -> None:
    """Two clips of one person cannot be prepared; each has a dub."""
    path = write_manifest(tmp_path, ["bad", "worse"], {"one": "bad", "two": "worse"})
    jobs = jobs_of(path).by_label
    both = Job("identity", "both", tmp_path)
    for one in ("bad", "worse"):
        both.stages |= jobs[f"identity/{one}"].stages
    dubs = [replace(jobs[f"dub/{name}"], waits_for=(both.label,)) for name in ("one", "two")]
    outcomes = runner.run(Jobs.of([both, *dubs]), Options(), Listener())
    said = [str(outcomes[f"dub/{name}"].failure) for name in ("one", "two")]
    assert said[0] == "identity both failed: cannot (bad.mp4): do this"
    assert "nobody thought of this" in said[1]


def test_one_line_that_fails_fails_its_scene_and_not_the_other_lines(
    tmp_path: Path, executor: Make
) -> None:
    path = write_manifest(tmp_path, PEOPLE, {"scene": "ann bob"})
    folder = tmp_path / "out" / "dubs" / "scene" / "cues" / "ann"
    folder.mkdir(parents=True)
    (folder / "listen.claim").touch()  # nobody can claim it
    outcomes = runner.run(jobs_of(path), Options(), Listener(), executor(path))
    assert states(outcomes) == {"ann": "made", "bob": "made", "scene": "failed"}
    failure = outcomes["dub/scene"].failure
    assert failure is not None
    assert failure.stage == "listen"
    assert "scene/render bob" in begun(path)
    assert not {"scene/listen ann", "scene/render ann", "scene/composite"} & {*begun(path)}


def test_a_stage_is_done_again_when_it_is_forced(tmp_path: Path, executor: Make) -> None:
    path = write_manifest(tmp_path, ["ann"])
    runner.run(jobs_of(path), Options(), Listener(), executor(path))
    listener = Listener()
    runner.run(jobs_of(path), Options(force=("finetune",)), listener, executor(path))
    assert listener.began == ["ann:finetune"]
    assert begun(path).count("ann/finetune") == 2


@pytest.mark.parametrize("kind", ["processes", "dask"], indirect=True)
def test_a_process_that_is_killed_is_started_three_times(tmp_path: Path, executor: Make) -> None:
    path = write_manifest(tmp_path, ["killed", "killed_once"])
    outcomes = runner.run(jobs_of(path), Options(), Listener(), executor(path))
    assert states(outcomes) == {"killed": "failed", "killed_once": "made"}
    failure = outcomes["identity/killed"].failure
    assert failure is not None
    assert (failure.stage, failure.what) == ("prepare", "its process was killed, 3 times")
    assert "--jobs" in failure.remedy
    count = Counter(begun(path))
    assert (count["killed/prepare"], count["killed_once/prepare"]) == (3, 2)
    assert not list((tmp_path / "out").rglob("*.claim"))


@pytest.mark.parametrize("kind", ["processes", "dask"], indirect=True)
def test_workers_killed_at_random_cost_their_own_stage_alone(
    tmp_path: Path, executor: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    people, dubs = ["slow_ann"], {"slow_it": "slow_ann"}
    path = write_manifest(tmp_path, people, dubs)
    monkeypatch.setattr(runner, "TRIES", 100)
    folders = {name_of(node): node.stage.folder for node in graph(path)}
    hit: Counter[str] = Counter()
    ended = threading.Event()

    def kill() -> None:
        chance = Random(7)
        # The stages sleep for seconds in all, so a busy machine gives no fewer looks at them.
        while not ended.wait(0.02) and hit.total() < 4:
            at_work = {k: life for k, f in folders.items() if (life := claims.look(f))}
            if at_work and chance.random() < 0.1:
                key = chance.choice(sorted(at_work))
                try:
                    os.kill(at_work[key].process, signal.SIGKILL)
                    hit[key] += 1
                except ProcessLookupError:
                    pass

    killer = threading.Thread(target=kill)
    killer.start()
    outcomes = runner.run(jobs_of(path), Options(), Listener(), executor(path))
    ended.set()
    killer.join()
    assert set(states(outcomes).values()) == {"made"}
    assert hit.total() >= 2
    for key, count in Counter(begun(path)).items():
        assert count <= 1 + hit[key], key
    calm = tmp_path / "calm"
    calm.mkdir()
    whole = write_manifest(calm, people, dubs)
    runner.run(jobs_of(whole), Options(), Listener())
    assert results(path) == results(whole)  # no claim, no partial work is left


def test_two_runs_share_the_work(
    tmp_path: Path, executor: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "LOOK_S", 0.05)
    path = write_manifest(tmp_path, ["slow_ann"], {"it": "slow_ann"})

    def run(made: Executor) -> dict[str, Outcome]:
        return runner.run(jobs_of(path), Options(), Listener(), made)

    both = [executor(path), executor(path)]
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(run, both)
    assert Counter(begun(path)).most_common(1)[0][1] == 1  # nothing was done twice
    assert len(begun(path)) == len(graph(path))
    for label in first:
        assert {first[label].state, second[label].state} <= {"made", "kept"}


@pytest.mark.parametrize("kind", ["processes"], indirect=True)
def test_a_manifest_that_changed_meanwhile_fails_the_job(
    tmp_path: Path, executor: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_manifest(tmp_path, ["ann"])
    jobs = jobs_of(path)
    job = jobs.by_label["identity/ann"]
    job.add(replace(job.stage(small_graph.Prepare), seed=3))
    outcomes = runner.run(jobs, Options(), Listener(), executor(path))
    failure = outcomes["identity/ann"].failure
    assert failure is not None
    assert "not what it was where the run was started" in failure.what


@dataclass(frozen=True, kw_only=True)
class Prepare(small_graph.Prepare):
    """Reads a file, or fails with an error."""

    clip: Path | None = None
    error: Setting[type[BaseException]] = ValueError

    def run(self, out: Path, progress: Progress) -> None:
        raise self.error("odd data")


class LibraryError(Exception):
    """Of a library's own kind."""


ODD = [TypeError, AttributeError, ImportError, LibraryError, RecursionError, PermissionError]


@pytest.mark.parametrize("error", ODD)
def test_whatever_a_library_raises_fails_its_own_job_alone(
    tmp_path: Path, error: type[BaseException]
) -> None:
    jobs = jobs_of(write_manifest(tmp_path, PEOPLE))
    jobs.by_label["identity/bob"].add(Prepare(name="bob", log=tmp_path / LOG, error=error))
    outcomes = runner.run(jobs, Options(), Listener())
    assert outcomes["identity/ann"].state == "made"
    failure = outcomes["identity/bob"].failure
    assert failure is not None
    assert "odd data" in failure.what
    assert error.__name__ in failure.trace


def test_inputs_that_cannot_be_looked_at_fail_their_own_job_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs = jobs_of(write_manifest(tmp_path, PEOPLE))
    locked = tmp_path / "odd.mp4"
    locked.touch()
    jobs.by_label["identity/bob"].add(Prepare(name="bob", log=tmp_path / LOG, clip=locked))

    def refused(path: Path) -> str:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("dubbing.engine.disk.file_digests.digest_file", refused)
    outcomes = runner.run(jobs, Options(), Listener())
    failure = outcomes["identity/bob"].failure
    assert failure is not None
    assert (failure.what, failure.where) == ("Permission denied", str(locked))
    assert failure.stage == "prepare"


class Impatient(Listener):
    """Interrupts when the first stage is done."""

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        raise KeyboardInterrupt


def test_an_interrupt_ends_what_runs_and_does_not_wait_for_the_rest(tmp_path: Path) -> None:
    path = write_manifest(tmp_path, [f"slow{k}" for k in range(10)])
    with closing(Processes(program(path), 2)) as made, pytest.raises(KeyboardInterrupt):
        runner.run(jobs_of(path), Options(), Impatient(), made)
    assert 1 <= len(begun(path)) <= 5
    assert not list((tmp_path / "out").rglob("*.claim"))


def test_a_process_has_the_environment_of_its_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is a fork of one that was started before, perhaps with other programs in its PATH."""
    (tmp_path / "telling.py").write_text("""
import json, os
def main(argument):
    print(json.dumps({"state": os.environ["TOLD"], "seconds": 0, "failure": None}))
    return 0
""")
    monkeypatch.syspath_prepend(tmp_path)
    stage = jobs_of(write_manifest(tmp_path, PEOPLE)).all()[0].stage(small_graph.Prepare)
    for value in ("one", "two"):
        monkeypatch.setenv("TOLD", value)
        with closing(Processes(Program("telling", ()), 1)) as executor:
            executor.submit(Task(0, stage, False, {}, lambda: None, lambda *_: None))
            assert [done.state for done in executor.wait(60)] == [value]


def test_a_claim_of_another_run_is_not_waited_for_before_the_rest_is_done(tmp_path: Path) -> None:
    path = write_manifest(tmp_path, PEOPLE)
    jobs = jobs_of(path)
    waited: list[str] = []

    class Watching(Listener):
        def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
            super().begin(job, stage, reasons)
            waited.extend(reasons if "another run is at work on it" in reasons else [])

    listener = Watching()
    other = claims.hold(jobs.by_label["identity/ann"].stage(small_graph.Prepare).folder)
    other.__enter__()

    def give_back() -> None:
        while "bob:finetune" not in listener.began or not waited:
            time.sleep(0.05)
        other.__exit__(None, None, None)

    threading.Thread(target=give_back).start()
    outcomes = runner.run(jobs, Options(), listener, InLine())
    assert set(states(outcomes).values()) == {"made"}
    assert begun(path)[:3] == ["bob/prepare", "ann/check_source", "bob/check_source"]
