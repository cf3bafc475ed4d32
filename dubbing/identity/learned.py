"""Which seconds of their clips a person was learned from, as the fine-tune wrote them down."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from typing_extensions import TypedDict

from dubbing import json_records as kept
from dubbing.errors import DubbingError

SUMMARY_FILE = "finetune.json"  # beside a model: how it was learned


class Summary(TypedDict):
    """What is read of a fine-tune's summary."""

    learned: list[tuple[float, float]]
    beside: list[tuple[str, list[tuple[float, float]]]]


def learned_seconds(finetune: Path) -> list[list[tuple[float, float]]]:
    """From which second to which of each clip a person was learned from, the main clip first.

    Args:
        finetune: the stage's folder.

    Raises:
        DubbingError: its summary cannot be read.
    """
    summary = kept.read(finetune / SUMMARY_FILE, Summary, "summary of finetune")
    return [summary["learned"], *(seconds for _, seconds in summary["beside"])]


def learned_if_known(finetune: Path) -> list[tuple[float, float]]:
    """The same of the main clip; empty where it is not known yet."""
    try:
        return learned_seconds(finetune)[0]
    except DubbingError:
        return []


def in_words(learned: Sequence[tuple[float, float]]) -> str:
    """``learned from 3.0-6.0 s, 21.0-33.0 s``."""
    return "learned from " + ", ".join(f"{first:.1f}-{stop:.1f} s" for first, stop in learned)
