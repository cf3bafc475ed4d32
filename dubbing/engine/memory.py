"""Memory that runs short: how libraries say so, and what to do."""

import errno

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
