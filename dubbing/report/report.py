"""report.json and report.html: what was made, how good it is, and what to do where it failed."""

import csv
import os
import platform
from pathlib import Path
from typing import Any

from pydantic import ConfigDict
from typing_extensions import TypedDict

from dubbing import json_records
from dubbing.engine.graph import Job, Jobs
from dubbing.engine.outcome import Outcome
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json, atomic_write_text, read_bounded, remove_torn
from dubbing.identity.learned import in_words, learned_if_known
from dubbing.manifest.manifest import Manifest
from dubbing.manifest.overwriting import results_of
from dubbing.packages import missing_of
from dubbing.provenance import credentials
from dubbing.report import lines
from dubbing.report.page import (
    FAILED,
    MISSING,
    MOST_POINTS,
    PASSED,
    UNJUDGED,
    VERDICTS,
    WARNED,
    page_of,
)
from dubbing.report.peak_memory import peak_memory
from dubbing.report.sources import relative, shown, source_of
from dubbing.stages.kinds import SYNC_FILE
from dubbing.tasks import dependencies

SUMMARY = "prepared.json"
# In warnings of preparation that say whose face was taken.
OF_FACES = ("faces in a frame", "found by looks", "not found in the shots")
DATA, PAGE = "report.json", "report.html"
OF_SYNC = {"pass": PASSED, "warn": WARNED, "fail": FAILED}  # by the verdict of the sync check


class Sync(TypedDict, total=False):
    """The part of a sync check that the report reads."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    verdict: str
    reason: str
    words: str | None
    offset_frames: int | None
    offset_ms: float | None
    confidence: float | None
    distance: float | None
    curve: list[float]
    source: dict[str, Any] | None


class Prepared(TypedDict, total=False):
    """The part of a prepared clip's summary that the report reads."""

    warnings: list[str]
    residual_shift: float | None


def write(
    manifest: Manifest, everything: Jobs, outcomes: dict[str, Outcome], *, code: int, seconds: float
) -> Path:
    """Write ``report.json`` and ``report.html`` into the output folder; gives the page's path.

    Args:
        everything: all jobs of the manifest, those left out by ``--only`` included.

    Raises:
        DubbingError: they cannot be written there.
    """
    found = collect(manifest, everything, outcomes, code=code, seconds=seconds)
    data, page = manifest.output / DATA, manifest.output / PAGE
    for file in (data, page):
        remove_torn(file)
    atomic_write_json(data, found)
    atomic_write_text(page, page_of(found))
    return page


def verdict_of(state: str, sync: Sync) -> str:
    """What a dub comes to, of `VERDICTS`: that of its sync check, where it could be made."""
    if state in ("failed", "skipped"):
        return FAILED
    if state == "stopped" or not sync:
        return MISSING
    return OF_SYNC.get(str(sync.get("verdict")), UNJUDGED)


def collect(
    manifest: Manifest, everything: Jobs, outcomes: dict[str, Outcome], *, code: int, seconds: float
) -> dict[str, Any]:
    """The contents of the report, as plain data; see `write`."""
    absent = Outcome(state="not in this run")
    peak = peak_memory()
    dubs = {
        name: {**_dub(manifest, job, outcomes.get(job.label, absent)), "place": place}
        for place, (name, job) in enumerate(everything.dubs.items())
    }
    verdicts = [dub["verdict"] for dub in dubs.values()]
    return {
        "manifest": shown(manifest, manifest.path),
        "code": code,
        "seconds": round(seconds, 1),
        "peak_memory_mb": None if peak is None else peak // 2**20,
        "machine": {"cores": os.cpu_count(), "system": platform.platform()},
        "warnings": list(manifest.warnings),
        "identities": {
            name: _identity(manifest, job, outcomes.get(job.label, absent))
            for name, job in everything.identities.items()
        },
        "counts": {verdict: verdicts.count(verdict) for verdict in VERDICTS},
        "dubs": dubs,
    }


def sync_of(job: Job) -> Sync:
    """What the sync check of a job found; empty where there is none, or a damaged one."""
    stage = job.stages.get("check") or job.stages.get("check_source")
    return _read(stage.folder / SYNC_FILE, Sync, "sync check", []) if stage else {}


def _identity(manifest: Manifest, job: Job, outcome: Outcome) -> dict[str, Any]:
    identity = manifest.identities[job.name]
    prepared, model = job.stages["prepare"].folder, job.stages["finetune"].folder
    damaged: list[str] = []
    summary = _read(prepared / SUMMARY, Prepared, "prepared clip", damaged)
    curves = {name: _column(model / "loss.csv", name, damaged) for name in ("loss", "psnr")}
    sheet = prepared / "contact_sheet.png"
    return {
        **_common(job, outcome),
        "clip": shown(manifest, identity.clip),
        "consent": dependencies.consent_of(identity),
        "warnings": [*clip_warnings(job, damaged), *dict.fromkeys(damaged)],
        "residual_shift": summary.get("residual_shift"),
        "learned": in_words(learned) if (learned := learned_if_known(model)) else None,
        "contact_sheet": relative(manifest, sheet) if sheet.is_file() else None,
        **curves,
        "sync": _brief(sync_of(job)),
    }


def clip_warnings(job: Job, damaged: list[str]) -> list[str]:
    """Warnings of preparation about all clips of a person."""
    found = []
    for name, stage in job.stages.items():
        if stage.name == "prepare":
            summary = _read(stage.folder / SUMMARY, Prepared, "prepared clip", damaged)
            of = name.removeprefix("prepare").strip()
            found += [f"{of}: {w}" if of else w for w in summary.get("warnings", [])]
    return found


def found_by_looks(planned: Jobs) -> list[str]:
    """Whose face was taken in the clips that are prepared: of several, by looks and how surely."""
    return [
        f"{name}: {warning}"
        for name, job in planned.identities.items()
        for warning in clip_warnings(job, [])
        if any(words in warning for words in OF_FACES)
    ]


def _dub(manifest: Manifest, job: Job, outcome: Outcome) -> dict[str, Any]:
    dub = next(dub for dub in manifest.dubs if dub.name == job.name)
    scene = manifest.scenes.get(job.name)
    clip = scene.clip if scene else manifest.identities[dub.people[0]].clip
    # One of another codec may lie beside it, from before the manifest was changed.
    names = results_of(dub)
    video = manifest.output / names.get("proxy", names["video"])
    sync = sync_of(job)
    rows = lines.lines_of(manifest, dub, job)
    verdicts = [row["verdict"] or "unjudged" for row in rows]
    return {
        **_common(job, outcome),
        "identity": ", ".join(job.waits_for),
        "verdict": verdict_of(outcome.state, sync),
        "video": relative(manifest, video) if video.is_file() else None,
        **source_of(manifest, clip, dub.video_start),
        "undubbed": lines.undubbed_of(manifest, job.name),
        "lines": rows,
        "line_counts": {v: verdicts.count(v) for v in lines.COLOURS if v in verdicts},
        "untouched": lines.scene_of(job).get("untouched"),
        "kept": [] if rows else in_frames(lines.picture_of(job).get("own_pixels")),
        "overlaid": [] if rows else in_frames(lines.picture_of(job).get("overlaid")),
        "mark_found": (lines.picture_of(job).get("mark") or {}).get("found"),
        "label": dub.label.mark,
        "signed": "sign" in job.stages,
        "film_credentials": _film_credentials(job, clip),
        "mark": mark.id if scene and (mark := dependencies.mark_of(dub, scene)) else None,
        "sync": _brief(sync),
    }


def in_frames(parts: list[dict[str, Any]] | None) -> list[str]:
    """Runs of frames with their reasons, in words."""
    return [f"{part['reason']} {part['first']}-{part['stop']}" for part in parts or []]


def _film_credentials(job: Job, film: Path) -> str:
    """Problem of the credentials of the film that a dub was signed over; empty without one."""
    if "sign" not in job.stages or missing_of("c2pa") or not film.is_file():
        return ""
    return credentials.film_problem(film)[0]


def _common(job: Job, outcome: Outcome) -> dict[str, Any]:
    failure = outcome.failure
    return {
        "state": outcome.state,
        "failure": vars(failure) if failure else None,
        "stages": {
            kind: {
                "seconds": outcome.seconds.get(kind),
                "reasons": outcome.reasons.get(kind, []),
                "recorded_seconds": _recorded(job, kind),
            }
            for kind in dict.fromkeys(stage.name for stage in job.stages.values())
        },
    }


def _recorded(job: Job, kind: str) -> float | None:
    """Seconds that the stages of a kind took when they were made; None where one is not made."""
    records = [stage.record() for stage in job.stages.values() if stage.name == kind]
    seconds = [record["seconds"] for record in records if record]
    return round(sum(seconds), 2) if len(seconds) == len(records) else None


def _brief(sync: Sync) -> dict[str, Any] | None:
    if not sync:
        return None
    found = {key: sync.get(key) for key in Sync.__annotations__ if key != "source"}
    return {**found, "source_confidence": (sync.get("source") or {}).get("confidence")}


def _column(path: Path, name: str, damaged: list[str]) -> list[float]:
    """Numbers of a curve, empty without a file. ``damaged`` gets the error of another file."""
    if not os.path.lexists(path):
        return []
    try:
        text = read_bounded(path, json_records.MOST_BYTES).decode()
        values = [float(row[name]) for row in csv.DictReader(text.splitlines())]
    except (DubbingError, OSError, KeyError, TypeError, ValueError, csv.Error):
        damaged.append(f"{path}: is no curve of a training: run with --force finetune")
        return []
    return values[:: max(1, len(values) // MOST_POINTS)]


def _read(path: Path, shape: Any, whose: str, damaged: list[str]) -> Any:
    """A file of a stage, empty without one. ``damaged`` gets the error of another file."""
    if not os.path.lexists(path):
        return {}
    try:
        return json_records.read(path, shape, whose)
    except DubbingError as error:
        damaged.append(str(error))
        return {}
