"""Threads side by side: order, look-ahead, errors, and cores."""

import threading

import pytest
import torch

from dfrf.workers import Workers

CPU = torch.device("cpu")


def test_results_come_in_order_and_the_cores_are_shared_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(torch, "get_num_threads", lambda: 4)
    names = set()
    both = threading.Barrier(2, timeout=20)

    def work(k: int) -> int:
        names.add(threading.current_thread().name)
        both.wait()  # two at a time or never
        return k * k

    with Workers(CPU, 2) as workers:
        assert workers.count == 2
        assert list(workers.map(work, range(6))) == [0, 1, 4, 9, 16, 25]
    assert len(names) == 2


def test_little_is_begun_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "get_num_threads", lambda: 2)
    begun: list[int] = []
    with Workers(CPU, 2) as workers:
        results = workers.map(lambda k: begun.append(k) or k, range(100))  # type: ignore[func-returns-value]
        next(results)
        assert len(begun) <= 4


def test_an_error_reaches_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "get_num_threads", lambda: 2)
    with Workers(CPU, 2) as workers, pytest.raises(ZeroDivisionError):
        list(workers.map(lambda k: 1 // k, [1, 0, 2]))


def test_a_gpu_has_no_threads() -> None:
    with Workers(torch.device("cuda"), 4) as workers:
        assert workers.count == 1
        assert list(workers.map(lambda k: threading.current_thread(), [0])) == [
            threading.main_thread()
        ]


def test_the_callers_own_threads_stay_as_they_are() -> None:
    before = torch.get_num_threads()
    with Workers(CPU, 2) as workers:
        list(workers.map(lambda k: torch.ones(3) + k, range(4)))
    assert torch.get_num_threads() == before


@pytest.mark.parametrize("learns", [False, True])
def test_gradients_are_kept_as_in_the_calling_thread(
    monkeypatch: pytest.MonkeyPatch, learns: bool
) -> None:
    monkeypatch.setattr(torch, "get_num_threads", lambda: 2)
    weight = torch.ones(3, requires_grad=True)
    with Workers(CPU, 2) as workers, torch.set_grad_enabled(learns):
        results = list(workers.map(lambda k: weight * k, range(4)))
    assert [r.requires_grad for r in results] == 4 * [learns]
