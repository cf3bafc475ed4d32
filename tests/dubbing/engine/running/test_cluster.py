"""A scheduler that is odd, or dies, ends a run in words. Nothing is started here."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dubbing.batch.task import KNOWN
from dubbing.engine.errors import CallError, ExplainedError, StageError
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Stage
from dubbing.engine.graph.stage_id import StageId
from dubbing.engine.running import task as processes
from dubbing.engine.running.executors import FAILED, KILLED, Program, Task

distributed = pytest.importorskip("distributed")
from dubbing.engine.running.cluster import LOST, Cluster  # noqa: E402

pytestmark = pytest.mark.medium


PROGRAM = Program("some.module", ("m.yaml",))


@pytest.fixture(autouse=True)
def _nothing_is_left() -> Iterator[None]:
    """Dask closes a client that found nobody when it is collected, and hangs while it starts one.

    A run has one client, tests have many.
    """
    yield
    gc.collect()


class Client:
    """A client of Dask whose tasks never end."""

    def __init__(self, **_: object) -> None:
        self.status = "running"
        self.calls: list[Any] = []

    def submit(self, *_: object, **__: object) -> Any:
        future = SimpleNamespace(status="pending", add_done_callback=self.calls.append)
        self.future = future
        return future

    def cancel(self, _: object) -> None:
        assert self.status == "running"

    def close(self, timeout: float) -> None:
        if self.status == "closed":
            raise TimeoutError


@dataclass(frozen=True, kw_only=True)
class Composite(Stage):
    """Does nothing."""

    mark: tuple[str, str] = ("", "77")
    codec: str = "h264"
    code: Setting[str] = "1"

    @property
    def version(self) -> str:
        return self.code


def task(tmp_path: Path) -> Task:
    stage = Composite(id=StageId("dub/it", "composite"), folder=tmp_path / "a")
    return Task(0, stage, False, {}, print, print)


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cluster:
    monkeypatch.setattr(distributed, "Client", Client)
    return Cluster(PROGRAM, "tcp://10.0.0.1:8786")


@pytest.mark.parametrize(
    "content", ["[]", "3", "", "{", '{"address": 3}', '{"address": null}', "{}", "\xff", "[" * 9999]
)
def test_an_odd_scheduler_file_is_a_wrong_call(tmp_path: Path, content: str) -> None:
    file = tmp_path / "s.json"
    file.write_bytes(content.encode("latin-1"))
    with pytest.raises(CallError, match=r"s\.json.*start one with `dask scheduler`"):
        Cluster(PROGRAM, str(file))


@pytest.mark.parametrize("address", ["", "x", "tcp://", "tcp://a:b", "foo://1:2", "tcp://[::1"])
def test_an_odd_address_is_a_wrong_call(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dubbing.engine.running.cluster.ANSWER", "1s")
    with pytest.raises(CallError, match="no Dask scheduler answers"):
        Cluster(PROGRAM, address)


def test_a_scheduler_that_dies_fails_what_was_begun(cluster: Cluster, tmp_path: Path) -> None:
    """Dask closes its client then, and calls nobody."""
    cluster.submit(task(tmp_path))
    assert cluster.wait(0.0) == []
    cluster._client.status = "closed"
    (done,) = cluster.wait(0.0)
    assert done.state == FAILED
    assert done.failure is not None
    assert (done.failure.what, done.failure.where) == (LOST, "tcp://10.0.0.1:8786")
    assert "run again" in done.failure.remedy
    assert cluster.wait(0.0) == []
    with pytest.raises(ExplainedError, match="is gone"):
        cluster.submit(task(tmp_path))
    cluster.close()


@pytest.mark.parametrize(("after", "state"), [("running", KILLED), ("closed", FAILED)])
def test_a_connection_that_is_lost_may_come_back(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: str, state: str
) -> None:
    cluster.submit(task(tmp_path))
    client: Any = cluster._client
    client.status, client.future.status = "connecting", "cancelled"
    client.calls[0](client.future)
    waited = lambda _: setattr(client, "status", after)  # noqa: E731
    monkeypatch.setattr("dubbing.engine.running.cluster.time.sleep", waited)
    assert [done.state for done in cluster.wait(0.0)] == [state]


def test_a_machine_without_the_marks_key_is_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes.time, "sleep", lambda _: None)
    here = Composite(folder=tmp_path / "a")
    there = replace(here, mark=("ab", "77"))
    processes._expect(here, here.fingerprints(), KNOWN)
    with pytest.raises(StageError, match=r"the key of the invisible mark.*mark\.key"):
        processes._expect(here, there.fingerprints(), KNOWN)
    other = replace(here, code="2", codec="ffv1")
    with pytest.raises(StageError, match="started: the code, codec"):
        processes._expect(here, other.fingerprints(), KNOWN)
