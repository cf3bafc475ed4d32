"""Memory of this process: the most that it held; how libraries say that it runs short."""

import errno
import sys

SHORT = "memory ran short"
ROOM = "end other programs, use fewer --jobs or a smaller size, then run again"
# What torch, OpenCV, C++ and Python's threads say; none of them has a class of its own for it.
SAID = (
    "can't allocate memory",
    "cannot allocate memory",
    "out of memory",
    "not enough memory",
    "insufficient memory",
    "failed to allocate",
    "bad_alloc",
    "can't start new thread",
)


def peak_memory() -> int | None:
    """The most that was held, bytes; None where the system does not report it (Windows)."""
    try:
        import resource
    except ModuleNotFoundError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak  # macOS counts bytes, Linux KiB


def short_of_memory(error: BaseException) -> bool:
    """Whether an error, or what it came from, says that there was no memory left."""
    seen: BaseException | None = error
    while seen is not None:
        text = str(seen).casefold()
        named = isinstance(seen, MemoryError) or getattr(seen, "errno", None) == errno.ENOMEM
        if named or any(words in text for words in SAID):
            return True
        seen = seen.__cause__
    return False
