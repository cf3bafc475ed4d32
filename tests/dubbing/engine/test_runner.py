"""Jobs side by side, in processes of their own."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from dubbing.engine import runner as running
from dubbing.engine.graph import Job, Jobs
from dubbing.engine.runner import Failure, Options
from dubbing.engine.stage import Progress, Stage
from dubbing.errors import MediaError
from dubbing.stage_kinds import OF_IDENTITY
from tests.dubbing.batches import Listener


@dataclass(frozen=True)
class Write:
    """Says which process it ran in; fails for one name."""

    name: str

    def __call__(self, out: Path, progress: Progress) -> None:
        if self.name == "bad":
            raise MediaError("cannot", "bad.mp4", "do this")
        if self.name == "worse":
            raise ValueError("nobody thought of this")
        if self.name == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.name.startswith("slow"):
            time.sleep(0.3)
        (out / "pid").write_text(str(os.getpid()))


@dataclass(frozen=True)
class Raise:
    """Fails as libraries do at data they cannot deal with."""

    error: type[BaseException]

    def __call__(self, out: Path, progress: Progress) -> None:
        raise self.error("odd data")


class LibraryError(Exception):
    """Of a library's own kind."""


ODD = [TypeError, AttributeError, ImportError, LibraryError, RecursionError, PermissionError]


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("error", ODD)
def test_whatever_a_library_raises_fails_its_own_job_alone(
    tmp_path: Path, workers: int, error: type[BaseException]
) -> None:
    jobs = jobs_of(tmp_path, ("a", "odd"))
    stages = jobs.identities["odd"].stages
    stages["prepare"] = replace(stages["prepare"], produce=Raise(error))
    outcomes = running.run(jobs, Options(workers=workers), Listener())
    assert outcomes["identity/a"].state == "made"
    failure = outcomes["identity/odd"].failure
    assert failure is not None
    assert "odd data" in failure.what
    assert error.__name__ in failure.trace


def test_inputs_that_cannot_be_looked_at_fail_their_own_job_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs = jobs_of(tmp_path, ("a", "odd"))
    stages = jobs.identities["odd"].stages
    locked = tmp_path / "odd.mp4"
    locked.touch()
    stages["prepare"] = replace(stages["prepare"], inputs={"clip": locked})

    def refused(path: Path) -> str:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("dubbing.engine.stage.digest_file", refused)
    outcomes = running.run(jobs, Options(), Listener())
    failure = outcomes["identity/odd"].failure
    assert failure is not None
    assert (failure.what, failure.where) == ("Permission denied", str(locked))
    assert failure.stage == "prepare"


def jobs_of(folder: Path, names: tuple[str, ...]) -> Jobs:
    def job(name: str) -> Job:
        stages = {
            kind: Stage(kind, folder / name / kind, "1", {}, {}, Write(name))
            for kind in OF_IDENTITY
        }
        return Job("identity", name, stages)

    return Jobs({name: job(name) for name in names}, {})


@pytest.mark.parametrize("workers", [1, 2])
def test_jobs_side_by_side(tmp_path: Path, workers: int) -> None:
    listener = Listener()
    jobs = jobs_of(tmp_path, ("a", "bad", "worse", "b"))
    outcomes = running.run(jobs, Options(workers=workers), listener)
    states = {name: outcome.state for name, outcome in outcomes.items()}
    expected = {"a": "made", "bad": "failed", "worse": "failed", "b": "made"}
    assert states == {f"identity/{name}": state for name, state in expected.items()}
    failure = outcomes["identity/bad"].failure
    assert failure is not None
    assert (failure.what, failure.where, failure.remedy) == ("cannot", "bad.mp4", "do this")
    assert failure.trace == ""
    unforeseen = outcomes["identity/worse"].failure
    assert unforeseen is not None
    assert "nobody thought of this" in unforeseen.trace
    assert set(outcomes["identity/a"].seconds) == set(OF_IDENTITY)
    where = int((tmp_path / "a" / "prepare" / "pid").read_text())
    assert (where == os.getpid()) == (workers == 1)


def test_a_killed_worker_fails_its_own_job_alone(tmp_path: Path) -> None:
    jobs = jobs_of(tmp_path, ("killed", "a"))
    outcomes = running.run(jobs, Options(workers=2), Listener())
    assert outcomes["identity/a"].state == "made"
    assert outcomes["identity/killed"].state == "failed"
    failure = outcomes["identity/killed"].failure
    assert failure is not None
    assert (failure.stage, failure.what) == ("prepare", "its process was killed")
    assert "--jobs" in failure.remedy


class Impatient(Listener):
    """Interrupts when the first job is done."""

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        raise KeyboardInterrupt


def test_an_interrupt_does_not_wait_for_jobs_that_have_not_begun(tmp_path: Path) -> None:
    names = tuple(f"slow{k}" for k in range(10))
    with pytest.raises(KeyboardInterrupt):
        running.run(jobs_of(tmp_path, names), Options(workers=2), Impatient())
    begun = [name for name in names if (tmp_path / name / "prepare" / "pid").exists()]
    assert 1 <= len(begun) <= 5
