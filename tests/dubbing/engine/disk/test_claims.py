"""One process at a time holds a claim, whatever happens to those that held it."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from dubbing.engine.disk import claims, files, heartbeat
from dubbing.engine.errors import ExplainedError, LockedError, StageError
from dubbing.engine.graph.graph import Job, Jobs
from dubbing.engine.graph.stage import Stage
from dubbing.engine.running import runner
from tests.dubbing.engine.listener import Listener

pytestmark = pytest.mark.medium


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Claims that beat and go stale in fractions of a second."""
    for name, value in {"HEARTBEAT_S": 0.05, "STALE_S": 1.0, "POLL_S": 0.02}.items():
        monkeypatch.setattr(claims, name, value)


def left(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def killed_holder(path: Path) -> None:
    """A claim whose process was killed with -9."""
    code = (
        "import sys, os, pathlib; from dubbing.engine.disk import claims\n"
        "claims.take(pathlib.Path(sys.argv[1])); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert claims.look(path) is not None


def test_a_claim_is_refused_while_it_is_held_and_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "work" / "model"
    with claims.hold(path) as claim:
        claim.note("step 3 of 4", 0.75)
        with (
            pytest.raises(LockedError, match=f"wait for process {os.getpid()} on "),
            claims.hold(path),
        ):
            pass
        life = claims.look(path)
        assert life is not None
        assert life.process == os.getpid()
        assert left(path.parent) == ["model.claim"]
    assert left(path.parent) == []
    assert claims.look(path) is None


def test_how_far_the_work_is_can_be_read(tmp_path: Path, quick: None) -> None:
    with claims.hold(tmp_path / "model") as claim:
        claim.note("ä" * 300, 0.75)
        waited = time.monotonic() + 30
        while (life := claims.look(tmp_path / "model")) is None or not life.share:
            assert time.monotonic() < waited
        assert (life.message, life.share) == ("ä" * heartbeat.MOST_SHOWN, 0.75)


def test_one_of_many_holds_it(tmp_path: Path, quick: None) -> None:
    killed_holder(tmp_path / "model")  # all of them find a stale one first
    inside: list[int] = []

    def work(k: int) -> int:
        with claims.hold(tmp_path / "model", wait=True):
            inside.append(k)
            assert len(inside) == 1
            time.sleep(0.002)
            inside.remove(k)
        return k

    with ThreadPoolExecutor(8) as pool:
        assert sorted(pool.map(work, range(40))) == list(range(40))
    assert left(tmp_path) == []


def test_a_claim_of_a_killed_process_of_this_machine_is_taken_over_at_once(tmp_path: Path) -> None:
    killed_holder(tmp_path / "model")
    (tmp_path / ".model.claim.torn").mkdir()  # of one that was killed while it claimed
    claims.take(tmp_path / "model").release()
    assert left(tmp_path) == []


def test_a_claim_of_one_that_was_killed_after_its_work_is_swept_away(tmp_path: Path) -> None:
    killed_holder(tmp_path / "model")
    other = Elsewhere(tmp_path / "poses")
    with claims.hold(tmp_path / "prepared"):
        claims.sweep(tmp_path)
        assert left(tmp_path) == ["poses.claim", "prepared.claim"]
    other.claim.release()


class Elsewhere:
    """A claim of another machine, whose heart beats when it is asked to."""

    def __init__(self, path: Path) -> None:
        claim = claims.take(path)
        claim._end.set()
        claim._thread.join()
        self.claim, self.file = claim, claim._file
        found = claims.look(path)
        assert found is not None
        self.life = replace(found, machine="elsewhere", host="farm7", process=1)
        self.beat()

    def beat(self) -> None:
        self.life = replace(self.life, count=self.life.count + 1)
        with open(self.file, "r+b") as stream:
            stream.write(json.dumps(asdict(self.life)).ljust(heartbeat.BYTES).encode())


def test_a_silent_claim_of_another_machine_is_taken_over_by_one(
    tmp_path: Path, quick: None
) -> None:
    path = tmp_path / "model"
    other = Elsewhere(path)
    watches = [claims.Watch(path) for _ in range(2)]
    assert [watch.free() for watch in watches] == [False, False]
    with pytest.raises(LockedError, match="process 1 on farm7"):
        claims.take(path)
    time.sleep(claims.STALE_S + 0.1)
    assert watches[0].free()
    with claims.hold(path) as newer:
        assert not watches[1].free()  # the one it had watched is gone; this one is another
        with pytest.raises(StageError, match="gave no sign of life"):
            other.claim.check()  # it wakes up again
        other.claim.release()
        newer.check()


def test_a_claim_of_another_machine_that_beats_is_respected(
    tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(claims, "STALE_S", 60.0)  # however busy this machine is
    path = tmp_path / "model"
    other = Elsewhere(path)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(lambda: claims.hold(path).__enter__())
        while not waiting.done():
            other.beat()
            time.sleep(0.05)
    with pytest.raises(LockedError, match="farm7"):
        waiting.result()


@pytest.mark.parametrize("kind", ["link", "file", "pipe"])
def test_what_lies_in_its_place_is_reported_and_stays(tmp_path: Path, kind: str) -> None:
    place = tmp_path / "model.claim"
    other = tmp_path / "other"
    other.mkdir()
    make = {"link": lambda: place.symlink_to(other), "file": place.touch}
    make.get(kind, lambda: os.mkfifo(place))()
    with pytest.raises(ExplainedError, match=r"model\.claim"), claims.hold(tmp_path / "model"):
        pass
    assert left(tmp_path) == ["model.claim", "other"]
    assert left(other) == []


def test_a_disk_that_takes_nothing_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(os, "rename", refused)
    with pytest.raises(ExplainedError, match="Read-only file system"), claims.hold(tmp_path / "x"):
        pass


def test_a_dead_claim_that_may_not_be_removed_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another user's, in a folder that both may write to: it was waited for, for ever."""
    path = tmp_path / "model"
    killed_holder(path)
    (file,) = (tmp_path / "model.claim").iterdir()

    def denied(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "unlink", denied)
    for look in (lambda: claims.take(path), lambda: claims.Watch(path).free()):
        with pytest.raises(LockedError, match=rf"Permission denied.*{file.name}.*remove the fol"):
            look()
    with pytest.raises(LockedError), claims.hold(path, wait=True):
        pass
    claims.sweep(tmp_path)  # which nobody waits for


class Copy(Stage):
    """Does nothing."""


def test_a_run_ends_at_a_dead_claim_that_may_not_be_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(*_: object, **__: object) -> bool:
        raise LockedError("a run that ended has left its claim", "model.claim/1", "remove it")

    job = Job("identity", "ann", tmp_path)
    job.add(Copy())
    monkeypatch.setattr(claims.Watch, "free", denied)
    outcome = runner.run(Jobs.of([job]), runner.Options(), Listener())["identity/ann"]
    assert outcome.state == "failed"
    assert outcome.failure is not None
    assert outcome.failure.where == "model.claim/1"


def test_without_proc_only_the_heartbeat_tells(
    tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """macOS and Windows: no process is asked for by its number, which ends it on Windows."""
    monkeypatch.setattr(heartbeat, "PROCESSES", tmp_path / "proc")
    monkeypatch.setattr(os, "kill", None)
    heartbeat._machine.cache_clear()
    other = Elsewhere(tmp_path / "model")
    other.life = replace(other.life, machine=heartbeat._machine(), process=os.getpid())
    other.beat()
    watch = claims.Watch(tmp_path / "model")
    assert not watch.free()
    other.beat()
    assert not watch.free()
    assert watch.alive
    with pytest.raises(LockedError):
        claims.take(tmp_path / "model")
    monkeypatch.setattr(claims, "STALE_S", 0.0)
    time.sleep(0.01)
    assert watch.free()
    claims.take(tmp_path / "model").release()
    heartbeat._machine.cache_clear()


def test_windows_claims_over_an_empty_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that was killed while it gave its claim back leaves the folder, without a heartbeat."""
    claims.place_of(tmp_path / "model").mkdir()
    really = os.rename

    def rename(source: Path, target: Path) -> None:
        if os.path.exists(target):
            raise FileExistsError(errno.EEXIST, "Cannot create a file when it already exists")
        really(source, target)

    monkeypatch.setattr(os, "rename", rename)
    with monkeypatch.context() as patch:
        patch.setattr(files, "WINDOWS", True)
        claim = claims.take(tmp_path / "model")
    claim.release()
    assert left(tmp_path) == []
