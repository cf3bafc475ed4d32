"""What the stages of a job left for the report: sync checks, summaries, curves, seconds."""

import csv
import os
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict
from typing_extensions import TypedDict

from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import read_bounded
from dubbing.engine.graph.graph import Job, Jobs
from dubbing.errors import ExplainedError
from dubbing.pipeline import PERSON
from dubbing.preparation.file_names import SUMMARY
from dubbing.report.page import MOST_POINTS
from dubbing.stages.check import Check
from dubbing.stages.check_source import CheckSource
from dubbing.stages.prepare import Prepare
from dubbing.sync.records import SYNC_FILE

WarningKey = Literal["warnings", "face_warnings"]


class Sync(TypedDict, total=False):
    """The part of a sync check that the report reads."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    verdict: str
    reason: str
    words: str | None
    offset_frames: int | None
    offset_ms: float | None
    confidence: float | None
    closeness: float | None
    parts: dict[str, float]
    distance: float | None
    curve: list[float]
    source: dict[str, Any] | None


class Prepared(TypedDict, total=False):
    """The part of a prepared clip's summary that the report reads."""

    warnings: list[str]
    face_warnings: list[str]
    residual_shift: float | None


def sync_of(job: Job) -> Sync:
    """The result of a job's sync check; empty where there is none, or a damaged one."""
    check = next(iter([*job.all_of(Check), *job.all_of(CheckSource)]), None)
    return read(check.folder / SYNC_FILE, Sync, "sync check", []) if check else {}


def clip_warnings(job: Job, damaged: list[str], key: WarningKey = "warnings") -> list[str]:
    """Warnings of preparation about all clips of a person.

    Args:
        damaged: gets the errors of files that cannot be read.
        key: all warnings, or those that say whose face was taken.
    """
    found = []
    for stage in job.all_of(Prepare):
        summary = read(stage.folder / SUMMARY, Prepared, "prepared clip", damaged)
        of = stage.id.of
        found += [f"{of}: {w}" if of else w for w in summary.get(key, [])]
    return found


def face_warnings(planned: Jobs) -> list[str]:
    """Warnings that say whose face was taken in clips that are prepared."""
    return [
        f"{name}: {warning}"
        for name, job in planned.named(PERSON).items()
        for warning in clip_warnings(job, [], "face_warnings")
    ]


def recorded_seconds(job: Job, kind: str) -> float | None:
    """Seconds that the stages of a kind took when they were made; None where one is not made."""
    records = [stage.record() for stage in job.stages.values() if stage.kind == kind]
    seconds = [record["seconds"] for record in records if record]
    return round(sum(seconds), 2) if len(seconds) == len(records) else None


def brief(sync: Sync) -> dict[str, Any] | None:
    """A sync check with the confidence of its source alone, not all of it; None of an empty one."""
    if not sync:
        return None
    found = {key: sync.get(key) for key in Sync.__annotations__ if key != "source"}
    return {**found, "source_confidence": (sync.get("source") or {}).get("confidence")}


def column(path: Path, name: str, damaged: list[str]) -> list[float]:
    """Numbers of a curve, empty without a file. ``damaged`` gets the error of another file."""
    if not os.path.lexists(path):
        return []
    try:
        text = read_bounded(path, json_records.MOST_BYTES).decode()
        values = [float(row[name]) for row in csv.DictReader(text.splitlines())]
    except (ExplainedError, OSError, KeyError, TypeError, ValueError, csv.Error):
        damaged.append(f"{path}: is no curve of a training: run with --force finetune")
        return []
    return values[:: max(1, len(values) // MOST_POINTS)]


def read(path: Path, shape: Any, whose: str, damaged: list[str]) -> Any:
    """A file of a stage, empty without one. ``damaged`` gets the error of another file."""
    if not os.path.lexists(path):
        return {}
    try:
        return json_records.read(path, shape, whose)
    except ExplainedError as error:
        damaged.append(str(error))
        return {}
