"""Worker processes that compute shares of a step beside this process, one a core.

A step is thousands of small operations. Threads hand Python's lock to one another at each of them,
which costs two threads half of what the second core gives; processes do not.
"""

from __future__ import annotations

import mmap
import os
import pickle
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, Generic, Self, TypeVar

import torch
from torch import Tensor, nn

Share = TypeVar("Share")
Outcome = TypeVar("Outcome")


def can_fork(device: torch.device) -> bool:
    """Whether a process that computes there may be forked."""
    return device.type == "cpu" and sys.platform == "linux"


def share_state(model: nn.Module) -> None:
    """Moves parameters and buffers to memory that this process shares with its forks.

    Whatever is changed in place, which optimisers and the occupancy grid do, is changed for all.
    """
    for tensor in (*model.parameters(), *model.buffers()):
        if tensor.numel():
            tensor.data = _shared_copy(tensor.data)


def _shared_copy(tensor: Tensor) -> Tensor:
    # An anonymous mapping needs no file system: /dev/shm of a container may hold 64 MB.
    memory = mmap.mmap(-1, tensor.numel() * tensor.element_size())
    shared = torch.frombuffer(memory, dtype=tensor.dtype).view(tensor.shape)
    return shared.copy_(tensor)


class ShareProcesses(ExitStack, Generic[Share, Outcome]):
    """Forks of this process. Leaving the context ends them; so does the end of this process.

    This process computes the shares of a worker that has died.

    Args:
        work: the outcome of a share in a step. All else that it uses stays as it was when the
            context was entered, except for the tensors that `share_state` moved.
        count: processes beside this one.
    """

    def __init__(self, work: Callable[[int, Share], Outcome], count: int) -> None:
        super().__init__()
        self._work = work
        self._count = count
        self._pipes: list[Connection | None] = []

    def __enter__(self) -> Self:
        for _ in range(self._count):
            here, there = Pipe()
            child = os.fork()
            if not child:
                try:
                    for mine in (here, *self._pipes):
                        if mine is not None:
                            mine.close()
                    _serve(self._work, there)
                finally:
                    os._exit(0)
            there.close()
            self._pipes.append(here)
            self.callback(os.waitpid, child, 0)
            self.callback(here.close)
        self.callback(torch.set_num_threads, torch.get_num_threads())
        torch.set_num_threads(1)
        return self

    def outcomes(self, step: int, shares: Sequence[Share]) -> list[Outcome]:
        """Outcomes of all shares of a step, in their order."""
        members = self._count + 1
        for number, pipe in enumerate(self._pipes, 1):
            self._exchange(number, pipe, partial(_send, (step, shares[number::members])))
        by_member = [[self._work(step, share) for share in shares[::members]]]
        for number, pipe in enumerate(self._pipes, 1):
            outcomes = self._exchange(number, pipe, _receive)
            if outcomes is None:
                outcomes = [self._work(step, share) for share in shares[number::members]]
            by_member.append(outcomes)
        return [by_member[i % members][i // members] for i in range(len(shares))]

    def _exchange(
        self, number: int, pipe: Connection | None, talk: Callable[[Connection], Any]
    ) -> Any:
        """The result of `talk` with a worker; None where it has died."""
        if pipe is None:
            return None
        try:
            return talk(pipe)
        except (EOFError, OSError):
            self._pipes[number - 1] = None
            return None


def _serve(work: Callable[[int, Share], Outcome], pipe: Connection) -> None:
    """Computes shares until the other end is closed."""
    # An interrupt reaches all processes of a run; the first of them decides what follows.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    torch.set_num_threads(1)
    try:
        while True:
            step, shares = _receive(pipe)
            _send([work(step, share) for share in shares], pipe)
    except (EOFError, OSError):
        return


def _send(message: object, pipe: Connection) -> None:
    # `Connection.send` would pass tensors on as open files.
    pipe.send_bytes(pickle.dumps(message, pickle.HIGHEST_PROTOCOL))


def _receive(pipe: Connection) -> Any:
    return pickle.loads(pipe.recv_bytes())
