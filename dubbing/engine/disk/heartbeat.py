"""The sign of life in a claim: which process holds it, and how far its work is."""

import json
import os
import socket
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

PROCESSES = Path("/proc")  # of Linux
BYTES, MOST_SHOWN = 2048, 200  # of a heartbeat, always as many, and characters of its message


@dataclass(frozen=True)
class Heartbeat:
    """Who holds a claim, and how far the work is.

    Attributes:
        machine: unique to a machine (or a container on it); ``host`` is its name for people.
        process, started: which process there.
        count: another one at every beat.
        message, share: of the work, 0..1.
    """

    machine: str
    host: str
    process: int
    started: str
    count: int = 0
    message: str = ""
    share: float = 0.0

    @property
    def here(self) -> bool:
        """Whether its process is one of those that can be seen from here.

        None can without /proc: a number may be another process's by now, and to ask for one ends it
        on Windows. There only the heartbeat tells.
        """
        return self.machine == _machine() and (PROCESSES / "self" / "stat").exists()

    @property
    def alive(self) -> bool:
        """Whether its process, which is one of this machine, still runs."""
        return _started(self.process) == self.started


def content(count: int, message: str = "", share: float = 0.0) -> bytes:
    """The heartbeat of this process, as it is written."""
    process = os.getpid()
    own = (_machine(), socket.gethostname(), process, _started(process))
    life = Heartbeat(*own, count, message[:MOST_SHOWN], round(share, 4))
    return json.dumps(asdict(life)).ljust(BYTES).encode()


@lru_cache(maxsize=1)
def _machine() -> str:
    """A name that two processes share only if they see one another's process numbers."""
    parts = [socket.gethostname()]
    with suppress(OSError):
        parts.append((PROCESSES / "sys/kernel/random/boot_id").read_text().strip())
    with suppress(OSError):
        parts.append(os.readlink(PROCESSES / "self/ns/pid"))
    return " ".join(parts)


def _started(process: int) -> str:
    """When a process of this machine began; '' where there is none of that number, or no /proc."""
    try:
        status = (PROCESSES / str(process) / "stat").read_text(errors="replace")
    except OSError:
        return ""
    fields = status.rpartition(")")[2].split()
    return "" if fields[0] == "Z" else fields[19]
