"""A finding of `doctor`: one thing looked at."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing looked at. ``state``: fine, slow (works, but could be better) or lacking."""

    what: str
    state: str
    found: str
    remedy: str = ""
