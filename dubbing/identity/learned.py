"""Which seconds of their clips a person was learned from, as the fine-tune wrote them down."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from typing_extensions import TypedDict

from dubbing import json_records as kept
from dubbing.errors import DubbingError

SUMMARY_FILE = "finetune.json"  # beside a model: how it was learned

Seconds = list[tuple[float, float]]  # from which to which
Learned = Sequence[tuple[str, Seconds]]  # file names of clips, the main one first, with theirs


class Summary(TypedDict):
    """What is read of a fine-tune's summary."""

    clip: str
    learned: Seconds
    beside: list[tuple[str, Seconds]]


def learned(finetune: Path) -> Learned:
    """Which seconds of each clip a person was learned from.

    Args:
        finetune: the stage's folder.

    Raises:
        DubbingError: its summary cannot be read.
    """
    summary = kept.read(finetune / SUMMARY_FILE, Summary, "summary of finetune")
    return [(summary["clip"], summary["learned"]), *summary["beside"]]


def learned_if_known(finetune: Path) -> Learned:
    """The same; empty where it is not known yet."""
    try:
        return learned(finetune)
    except DubbingError:
        return []


def in_words(clips: Learned) -> str:
    """``learned from 3.0-6.0 s, 21.0-33.0 s``, with the names of clips where there are several."""
    parts = []
    for name, seconds in clips:
        if seconds:
            times = ", ".join(f"{first:.1f}-{stop:.1f} s" for first, stop in seconds)
            parts.append(f"{name} {times}" if len(clips) > 1 else times)
    return "learned from " + "; ".join(parts)
