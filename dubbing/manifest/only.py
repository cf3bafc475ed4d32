"""Which jobs of a manifest ``--only`` means."""

from collections.abc import Sequence
from fnmatch import fnmatchcase

from dubbing.errors import DubbingError

MOST_SHOWN = 20


def chosen_names(only: Sequence[str], names: Sequence[str]) -> set[str]:
    """The names that are meant; all of them where ``only`` is empty.

    Args:
        only: names, or patterns of names as a shell's: ``shot1_*``. A name goes before a pattern.

    Raises:
        DubbingError: one of ``only`` means nothing.
    """
    chosen: set[str] = set() if only else {*names}
    for pattern in only:
        found = {pattern} & {*names} or {name for name in names if fnmatchcase(name, pattern)}
        if not found:
            there = ", ".join(names[:MOST_SHOWN]) + (", ..." if len(names) > MOST_SHOWN else "")
            raise DubbingError(f"nothing is called {pattern}", "--only", f"there is {there}")
        chosen |= found
    return chosen
