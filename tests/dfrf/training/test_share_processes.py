"""Shares of a step in processes of their own: in order, whatever becomes of the processes."""

import os
import signal
import sys
import threading

import pytest
import torch

from dfrf import presets
from dfrf.config import TrainConfig
from dfrf.fast.fast_method import FastMethod
from dfrf.training.fit import FitOptions, fit
from dfrf.training.progress import TrainingProgress
from dfrf.training.share_processes import ShareProcesses, can_fork, share_state
from tests.dfrf.people import person, small_config

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks safely")
CPU = torch.device("cpu")


class Numbers(torch.nn.Module):
    """Stands in for a model: a parameter, a buffer, and an empty one."""

    factor: torch.Tensor
    flags: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        self.factor = torch.nn.Parameter(torch.tensor([2.0]))
        self.register_buffer("flags", torch.tensor([True, False]))
        self.register_buffer("nothing", torch.zeros(0, 3))


def children() -> list[int]:
    with open(f"/proc/self/task/{threading.get_native_id()}/children") as kept:
        return [int(number) for number in kept.read().split()]


def test_outcomes_come_in_order_and_from_more_than_one_process() -> None:
    def work(step: int, share: int) -> tuple[int, int, int]:
        return step, share, os.getpid()

    with ShareProcesses(work, 2) as processes:
        found = processes.outcomes(3, range(7))
    assert [one[:2] for one in found] == [(3, k) for k in range(7)]
    assert len({one[2] for one in found}) == 3


def test_what_changes_in_place_changes_in_the_processes() -> None:
    numbers = Numbers()
    share_state(numbers)

    def work(step: int, share: float) -> tuple[float, bool]:
        return float(numbers.factor) * share, bool(numbers.flags[1])

    with ShareProcesses(work, 1) as processes:
        assert processes.outcomes(0, [1.0, 10.0]) == [(2.0, False), (20.0, False)]
        with torch.no_grad():
            numbers.factor.mul_(2)
            numbers.flags.logical_not_()
        assert processes.outcomes(1, [1.0, 10.0]) == [(4.0, True), (40.0, True)]


def test_shares_of_a_process_that_is_gone_or_fails_are_worked_on_here() -> None:
    here = os.getpid()

    def work(step: int, share: int) -> int:
        if os.getpid() != here and (step, share) == (1, 1):
            os.kill(os.getpid(), signal.SIGKILL)
        if os.getpid() != here and (step, share) == (2, 2):
            raise MemoryError
        return os.getpid()

    with ShareProcesses(work, 2) as processes:
        assert here not in processes.outcomes(0, range(3))[1:]
        assert processes.outcomes(1, range(3))[1] == here
        assert processes.outcomes(2, range(3)) == [here] * 3
        assert processes.outcomes(3, range(3)) == [here] * 3


@pytest.mark.skipif(not can_fork(CPU), reason="no forks here")
def test_a_model_learns_the_same_while_its_processes_are_killed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    config = TrainConfig(
        iterations=4, rays=192, frames=4, warmup=2, occupancy_every=2, learn_references_every=0
    )
    someone = person()
    before = torch.get_num_threads()
    torch.set_num_threads(1)  # what threads add up comes in no fixed order
    seen: list[int] = []

    def kill_one(progress: TrainingProgress) -> None:
        seen.append(len(children()))
        if progress.step == 2:
            os.kill(children()[0], signal.SIGKILL)

    trained = []
    for cores, watch in ((1, None), (4, kill_one)):
        monkeypatch.setattr(torch, "get_num_threads", lambda cores=cores: cores)
        torch.manual_seed(1)
        model = presets.build(small_config())
        options = FitOptions(device="cpu", progress=watch)
        fit(FastMethod(model), [someone], config, {someone.name: torch.tensor([0, 5])}, options)
        trained.append(model.state_dict())
    torch.set_num_threads(before)
    assert seen[0] == 3
    assert not children()
    for name, value in trained[0].items():
        assert torch.equal(value, trained[1][name]), name
