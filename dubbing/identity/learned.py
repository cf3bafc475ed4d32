"""Files that a fine-tune leaves; the seconds of clips that a person was learned from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from typing_extensions import TypedDict

from dubbing.engine.disk import json_records as kept
from dubbing.errors import ExplainedError

MODEL_FILE = "model.safetensors"
# Beside a model: how it was fine-tuned, and its loss curve.
SUMMARY_FILE, CURVE_FILE = "finetune.json", "loss.csv"

Seconds = list[tuple[float, float]]  # first and last second of each part
# File names of clips, the main one first; their seconds, and those in which the head turns further.
Learned = Sequence[tuple[str, Seconds, Seconds]]


class Summary(TypedDict):
    """The keys of a fine-tune's summary that are read here."""

    clip: str
    learned: Seconds
    beside: list[tuple[str, Seconds]]
    turned: list[Seconds]


def learned(finetune: Path) -> Learned:
    """The seconds of each clip that a person was learned from.

    Args:
        finetune: the stage's folder.

    Raises:
        ExplainedError: its summary cannot be read.
    """
    summary = kept.read(finetune / SUMMARY_FILE, Summary, "summary of finetune")
    clips = [(summary["clip"], summary["learned"]), *summary["beside"]]
    return [(*clip, turned) for clip, turned in zip(clips, summary["turned"], strict=True)]


def learned_if_known(finetune: Path) -> Learned:
    """The same; empty before the fine-tune."""
    try:
        return learned(finetune)
    except ExplainedError:
        return []


def in_words(clips: Learned) -> str:
    """``learned from 3.0-6.0 s, 21.0-33.0 s``, with the names of clips where there are several.

    Where the head turns further elsewhere: ``and 1.2 s of turned heads``.
    """
    parts = []
    for name, seconds, turned in clips:
        times = ", ".join(f"{first:.1f}-{stop:.1f} s" for first, stop in seconds)
        if turned:
            further = f"{sum(stop - first for first, stop in turned):.1f} s of turned heads"
            times = f"{times} and {further}" if times else further
        if times:
            parts.append(f"{name} {times}" if len(clips) > 1 else times)
    return "learned from " + "; ".join(parts)
