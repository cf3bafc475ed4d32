"""report.json and report.html: what was made, how good it is, and what to do where it failed."""

from __future__ import annotations

import csv
import math
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup
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
from dubbing.printable import visible
from dubbing.report import lines
from dubbing.report.peak_memory import peak_memory
from dubbing.stages.kinds import SYNC_FILE
from dubbing.tasks import dependencies

MOST_POINTS = 400  # of a curve on the page
SUMMARY = "prepared.json"
DATA, PAGE = "report.json", "report.html"
# What a dub comes to, the worst first, and which verdicts of the sync check say so.
FAILED, WARNED, PASSED, UNJUDGED, MISSING = "failed", "warned", "passed", "unjudged", "missing"
VERDICTS = (FAILED, WARNED, UNJUDGED, MISSING, PASSED)
OF_SYNC = {"pass": PASSED, "warn": WARNED, "fail": FAILED}


class Sync(TypedDict, total=False):
    """What of a sync check is shown."""

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
    """What of a prepared clip is shown."""

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


def page_of(found: dict[str, Any]) -> str:
    """The page that shows what `collect` found: one file, which needs no network."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, finalize=_shown
    )
    environment.filters |= {"curve": curve, "worst_first": worst_first}
    template = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    return environment.from_string(template).render(found, first_line=first_line(found))


def first_line(found: dict[str, Any]) -> str:
    """How many dubs passed, warned and failed: ``3 dubs: 2 passed, 1 warned, 0 failed``."""
    counts = found["counts"]
    named = [PASSED, WARNED, FAILED, *(v for v in (UNJUDGED, MISSING) if counts[v])]
    total = sum(counts.values())
    said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in named)
    return f"{total} dub{'' if total == 1 else 's'}: {said}"


def worst_first(dubs: dict[str, Any]) -> list[tuple[str, Any]]:
    """Names and dubs by verdict; of one verdict, those first whose sync check is least sure."""

    def rank(item: tuple[str, Any]) -> tuple[int, float]:
        sync = item[1]["sync"] or {}
        return VERDICTS.index(item[1]["verdict"]), sync.get("confidence") or 0.0

    return sorted(dubs.items(), key=rank)


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
        "manifest": str(manifest.path),
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
        "clip": str(identity.clip),
        "consent": dependencies.consent_of(identity),
        "warnings": [*clip_warnings(job, damaged), *dict.fromkeys(damaged)],
        "residual_shift": summary.get("residual_shift"),
        "learned": in_words(learned)
        if (learned := learned_if_known(job.stages["finetune"].folder))
        else None,
        "contact_sheet": _relative(manifest, sheet) if sheet.is_file() else None,
        **curves,
        "sync": _brief(sync_of(job)),
    }


def clip_warnings(job: Job, damaged: list[str]) -> list[str]:
    """What preparation says of the clips of a person, those before which a name stands included."""
    found = []
    for name, stage in job.stages.items():
        if stage.name == "prepare":
            summary = _read(stage.folder / SUMMARY, Prepared, "prepared clip", damaged)
            of = name.removeprefix("prepare").strip()
            found += [f"{of}: {said}" if of else said for said in summary.get("warnings", [])]
    return found


def found_by_looks(planned: Jobs) -> list[str]:
    """Who was found in which shots of the clips that are prepared, and how surely."""
    return [
        f"{name}: {said}"
        for name, job in planned.identities.items()
        for said in clip_warnings(job, [])
        if "found by looks" in said or "not found in the shots" in said
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
        "video": _relative(manifest, video) if video.is_file() else None,
        "source": _relative(manifest, clip) if clip.is_file() else None,
        "source_start": dub.video_start,
        "lines": rows,
        "line_counts": {v: verdicts.count(v) for v in lines.COLOURS if v in verdicts},
        "untouched": lines.scene_of(job).get("untouched"),
        "signed": "sign" in job.stages,
        "mark": mark.id if scene and (mark := dependencies.mark_of(dub, scene)) else None,
        "sync": _brief(sync),
    }


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
    kept = [record["seconds"] for record in records if record]
    return round(sum(kept), 2) if len(kept) == len(records) else None


def _brief(sync: Sync) -> dict[str, Any] | None:
    keys = ("verdict", "reason", "words", "offset_frames", "offset_ms", "confidence", "distance")
    if not sync:
        return None
    found = {key: sync.get(key) for key in (*keys, "curve")}
    source: dict[str, Any] = sync.get("source") or {}
    found["source_confidence"] = source.get("confidence")
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


def _column(path: Path, name: str, damaged: list[str]) -> list[float]:
    """Numbers of a curve; none where there is no file. Says so where it is another file."""
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
    """A file of a stage; empty where there is none. Says so where it is another file."""
    if not os.path.lexists(path):
        return {}
    try:
        return json_records.read(path, shape, whose)
    except DubbingError as error:
        damaged.append(str(error))
        return {}


def _shown(value: Any) -> Any:
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _relative(manifest: Manifest, path: Path) -> str:
    """The way from the page to a file, which may lie elsewhere."""
    return Path(os.path.relpath(path, manifest.output)).as_posix()
