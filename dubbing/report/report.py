"""report.json and report.html: what was made, how good it is, and what to do where it failed."""

import os
import platform
from pathlib import Path
from typing import Any

from dubbing.engine.disk.files import atomic_write_json, atomic_write_text, remove_torn
from dubbing.engine.disk.numbered import is_there, plain
from dubbing.engine.graph.graph import Job, Jobs
from dubbing.engine.memory import peak_memory
from dubbing.engine.running.outcome import Outcome
from dubbing.identity.learned import CURVE_FILE, in_words, learned_if_known
from dubbing.manifest.edits.notes import told
from dubbing.packages import missing_of
from dubbing.pipeline import DUB, PERSON
from dubbing.preparation.file_names import CONTACT_SHEET, SUMMARY
from dubbing.production.production import REPORTS, Production
from dubbing.provenance import credentials
from dubbing.report import lines
from dubbing.report.findings import (
    Prepared,
    Sync,
    brief,
    clip_warnings,
    column,
    read,
    recorded_seconds,
    sync_of,
)
from dubbing.report.page import FAILED, MISSING, PASSED, UNJUDGED, VERDICTS, WARNED, page_of
from dubbing.report.sources import relative, shown, source_of
from dubbing.report.takes import takes_of
from dubbing.report.thumbnails import thumbnail_of
from dubbing.stages.finetune import Finetune
from dubbing.stages.prepare import Prepare
from dubbing.stages.sign import Sign

PAGE, DATA = REPORTS
OF_SYNC = {"pass": PASSED, "warn": WARNED, "fail": FAILED}  # by the verdict of the sync check


def write(
    production: Production,
    everything: Jobs,
    outcomes: dict[str, Outcome],
    *,
    code: int,
    seconds: float,
) -> Path:
    """Write ``report.json`` and ``report.html`` into the output folder; gives the page's path.

    Args:
        everything: all jobs of the manifest, those left out by ``--only`` included.

    Raises:
        ExplainedError: they cannot be written there.
    """
    found = collect(production, everything, outcomes, code=code, seconds=seconds)
    data, page = production.output / DATA, production.output / PAGE
    for file in (data, page):
        remove_torn(file)
    atomic_write_json(data, found)
    atomic_write_text(page, page_of(found))
    return page


def verdict_of(state: str, sync: Sync) -> str:
    """Verdict of a dub, of `VERDICTS`: that of its sync check, if it could be made."""
    if state in ("failed", "skipped"):
        return FAILED
    if state == "stopped" or not sync:
        return MISSING
    return OF_SYNC.get(str(sync.get("verdict")), UNJUDGED)


def collect(
    production: Production,
    everything: Jobs,
    outcomes: dict[str, Outcome],
    *,
    code: int,
    seconds: float,
) -> dict[str, Any]:
    """Contents of the report, as plain data; see `write`."""
    absent = Outcome(state="not in this run")
    peak = peak_memory()
    dubs = {
        name: {**_dub(production, job, outcomes.get(job.label, absent)), "place": place}
        for place, (name, job) in enumerate(everything.named(DUB).items())
    }
    verdicts = [dub["verdict"] for dub in dubs.values()]
    return {
        "manifest": shown(production, production.manifest),
        "code": code,
        "seconds": round(seconds, 1),
        "peak_memory_mb": None if peak is None else peak // 2**20,
        "machine": {"cores": os.cpu_count(), "system": platform.platform()},
        "warnings": list(production.warnings),
        "identities": {
            name: _person(production, job, outcomes.get(job.label, absent))
            for name, job in everything.named(PERSON).items()
        },
        "counts": {verdict: verdicts.count(verdict) for verdict in VERDICTS},
        "dubs": dubs,
    }


def _person(production: Production, job: Job, outcome: Outcome) -> dict[str, Any]:
    person = production.people[job.name]
    prepared, model = job.stage(Prepare).folder, job.stage(Finetune).folder
    damaged: list[str] = []
    summary = read(prepared / SUMMARY, Prepared, "prepared clip", damaged)
    curves = {name: column(model / CURVE_FILE, name, damaged) for name in ("loss", "psnr")}
    sheet = prepared / CONTACT_SHEET
    return {
        **_common(job, outcome),
        "clip": shown(production, plain(person.clip.path)),
        "consent": person.consent.record(),
        "warnings": [
            *clip_warnings(job, damaged, "face_warnings"),
            *clip_warnings(job, damaged),
            *dict.fromkeys(damaged),
        ],
        "residual_shift": summary.get("residual_shift"),
        "learned": in_words(learned) if (learned := learned_if_known(model)) else None,
        "contact_sheet": relative(production, sheet) if sheet.is_file() else None,
        **curves,
        "sync": brief(sync_of(job)),
    }


def _dub(production: Production, job: Job, outcome: Outcome) -> dict[str, Any]:
    dub = production.dubs[job.name]
    # One of another codec may lie beside it, from before the manifest was changed.
    names = dub.results()
    video = production.output / names.get("proxy", names["video"])
    sync, picture = sync_of(job), lines.picture_of(job)
    rows, mark = lines.lines_of(dub, job), dub.marking()
    verdicts = [row["verdict"] or "unjudged" for row in rows]
    reach = [picture.get("reach", {}).get(cue.name) for cue in dub.cues]
    start = float(dub.first / dub.film.rate) if dub.cues else 0.0
    middle = (dub.cues[0].first + min(dub.cues[0].stop, dub.length)) // 2 if dub.cues else 0
    thumbnail = thumbnail_of(video, middle, production.work) if video.is_file() else None
    return {
        **_common(job, outcome),
        "identity": ", ".join(person.name for person in dub.people),
        "verdict": verdict_of(outcome.state, sync),
        "video": relative(production, video) if video.is_file() else None,
        "thumbnail": relative(production, thumbnail) if thumbnail else None,
        "rate": float(dub.film.rate) if dub.cues else 1.0,
        **source_of(production, dub.film.path, start),
        "undubbed": lines.undubbed_of(dub),
        "lines": [
            row
            | {"reach": of.in_words() if of else "", "short": bool(of and of.short)}
            | {"edit": cue.edit.in_words(), "cue": cue.name, "told": told(cue)}
            | {"takes": takes_of(job, cue, cue.edit)}
            for row, of, cue in zip(rows, reach, dub.cues, strict=True)
        ],
        "short_lines": sum(of is not None and of.short for of in reach),
        "line_counts": {v: verdicts.count(v) for v in lines.COLOURS if v in verdicts},
        "untouched": lines.scene_of(job).get("untouched"),
        "kept": lines.in_frames(picture.get("own_pixels", [])),
        "overlaid": lines.in_frames(picture.get("overlaid", [])),
        "mark_found": picture.get("mark", {}).get("found"),
        "delivered": picture.get("delivered"),
        "label": dub.settings.label,
        "signed": bool(job.all_of(Sign)),
        "film_credentials": _film_credentials(job, dub.film.path),
        "mark": mark.id if mark else None,
        "sync": brief(sync),
    }


def _film_credentials(job: Job, film: Path) -> str:
    """Problem of the credentials of the film that a dub was signed over; empty without one."""
    if not job.all_of(Sign) or missing_of("c2pa") or not is_there(film):
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
                "recorded_seconds": recorded_seconds(job, kind),
            }
            for kind in dict.fromkeys(stage.kind for stage in job.stages.values())
        },
    }
