"""report.json and report.html: what was made, how good it is, and what to do where it failed."""

from __future__ import annotations

import csv
import json
import math
import os
import platform
import resource
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2

from dubbing import jobs as all_jobs
from dubbing.engine.runner import Outcome, label
from dubbing.files import atomic_write_json, atomic_write_text
from dubbing.jobs import Job, Jobs
from dubbing.manifest.manifest import Manifest
from dubbing.report.page import TEMPLATE
from dubbing.stages.steps import SYNC_FILE

MOST_POINTS = 400  # of a curve on the page


def write(
    manifest: Manifest, planned: Jobs, outcomes: dict[str, Outcome], *, code: int, seconds: float
) -> Path:
    """Write ``report.json`` and ``report.html`` into the output folder; gives the page's path."""
    found = collect(manifest, planned, outcomes, code=code, seconds=seconds)
    atomic_write_json(manifest.output / "report.json", found)
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["curve"] = curve
    page = manifest.output / "report.html"
    atomic_write_text(page, environment.from_string(TEMPLATE).render(found))
    return page


def collect(
    manifest: Manifest, planned: Jobs, outcomes: dict[str, Outcome], *, code: int, seconds: float
) -> dict[str, Any]:
    """Everything the report says, as plain data. Jobs left out by ``--only`` are listed too."""
    everything = all_jobs.build(manifest)
    absent = Outcome(state="not in this run")
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return {
        "manifest": str(manifest.path),
        "code": code,
        "seconds": round(seconds, 1),
        "peak_memory_mb": usage.ru_maxrss // 1024,
        "machine": {"cores": os.cpu_count(), "system": platform.platform()},
        "warnings": list(manifest.warnings),
        "identities": {
            name: _identity(manifest, job, outcomes.get(label(job), absent))
            for name, job in everything.identities.items()
        },
        "dubs": {
            name: _dub(manifest, job, outcomes.get(label(job), absent))
            for name, job in everything.dubs.items()
        },
    }


def sync_of(job: Job) -> dict[str, Any]:
    """What the sync check of a job found; empty where there is none."""
    stage = job.stages.get("sync") or job.stages.get("source")
    return _json(stage.folder / SYNC_FILE) if stage else {}


def _identity(manifest: Manifest, job: Job, outcome: Outcome) -> dict[str, Any]:
    identity = manifest.identities[job.name]
    prepared, model = job.stages["prepare"].folder, job.stages["finetune"].folder
    told = _json(prepared / "prepared.json")
    sheet = prepared / "contact_sheet.png"
    return {
        **_common(job, outcome),
        "clip": str(identity.clip),
        "consent": identity.consent.model_dump(mode="json"),
        "warnings": told.get("warnings", []),
        "residual_shift": told.get("residual_shift"),
        "contact_sheet": _relative(manifest, sheet) if sheet.is_file() else None,
        "loss": _column(model / "loss.csv", "loss"),
        "psnr": _column(model / "loss.csv", "psnr"),
        "sync": _brief(sync_of(job)),
    }


def _dub(manifest: Manifest, job: Job, outcome: Outcome) -> dict[str, Any]:
    codec = next(dub.codec for dub in manifest.dubs if dub.name == job.name)
    # One of another codec may lie beside it, from before the manifest was changed.
    video = manifest.output / f"{job.name}{all_jobs.SUFFIX[codec]}"
    return {
        **_common(job, outcome),
        "identity": job.waits_for,
        "video": _relative(manifest, video) if video.is_file() else None,
        "sync": _brief(sync_of(job)),
    }


def _common(job: Job, outcome: Outcome) -> dict[str, Any]:
    failure = outcome.failure
    return {
        "state": outcome.state,
        "failure": vars(failure) if failure else None,
        "stages": {
            name: {
                "seconds": outcome.seconds.get(name),
                "reasons": outcome.reasons.get(name, []),
                "recorded_seconds": (stage.record() or {}).get("seconds"),
            }
            for name, stage in job.stages.items()
        },
    }


def _brief(sync: dict[str, Any]) -> dict[str, Any] | None:
    keys = ("verdict", "reason", "words", "offset_frames", "offset_ms", "confidence", "distance")
    if not sync:
        return None
    found = {key: sync.get(key) for key in (*keys, "curve")}
    found["source_confidence"] = (sync.get("source") or {}).get("confidence")
    return found


def curve(values: Sequence[float], width: int = 320, height: int = 80) -> str:
    """Points of an SVG polyline through finite ``values``, low values at the bottom."""
    step = max(1, len(values) // MOST_POINTS)
    kept = [v for v in values[::step] if math.isfinite(v)]
    if len(kept) < 2:
        return ""
    low, high = min(kept), max(kept)
    across, up = width / (len(kept) - 1), height / ((high - low) or 1)
    return " ".join(f"{k * across:.1f},{(high - v) * up:.1f}" for k, v in enumerate(kept))


def _column(path: Path, name: str) -> list[float]:
    if not path.is_file():
        return []
    with open(path, encoding="utf-8", newline="") as stream:
        values = [float(row[name]) for row in csv.DictReader(stream)]
    return values[:: max(1, len(values) // MOST_POINTS)]


def _json(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def _relative(manifest: Manifest, path: Path) -> str:
    return path.relative_to(manifest.output).as_posix()
