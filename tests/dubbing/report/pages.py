"""Stand-in results of a run, as `dubbing.report.page.page_of` takes them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from dubbing.identity.learned import in_words
from dubbing.report.page import VERDICTS, page_of
from dubbing.report.report import verdict_of
from tests import clips

MIXED = (
    ("fine", "pass", 0.3),
    ("early", "warn", 0.2),
    ("still", "fail", 0.1),
    ("gone", "broken", 0.2),
    ("quiet", "unjudged", 0.0),
    ("weak", "pass", 0.2),
)
DUBS = (*MIXED, ("shot10", "warn", 0.1), ("shot9", "pass", 0.4))
SOURCE = "../clips/ann 100% #1?.mp4"


def dub_of(name: str, verdict: str, place: int, closeness: float | None = 0.2) -> dict[str, Any]:
    sync = {
        "verdict": verdict,
        "reason": f"measured {name}",
        "words": "in sync",
        "confidence": 0.2,
        "closeness": closeness,
        "parts": {"timing": 0.96, "sharpness": 0.5},
        "source_confidence": 0.3,
        "curve": [2.0, 1.0, 2.0],
    }
    state = "failed" if verdict == "broken" else "made"
    lost = {"stage": "render", "what": "lost", "where": "", "remedy": "try again", "trace": "at"}
    return {
        "state": state,
        "failure": lost if state == "failed" else None,
        "stages": {"render": {"seconds": 2.0, "reasons": ["new"], "recorded_seconds": None}},
        "identity": "ann",
        "verdict": verdict_of(state, sync),  # type: ignore[arg-type]
        "video": f"{name}.mp4",
        "thumbnail": None,
        "rate": 25.0,
        "source": "../clips/ann.mp4",
        "source_start": 1.5,
        "undubbed": [],
        "sync": sync,
        "place": place,
        "lines": [],
        "line_counts": {},
        "short_lines": 0,
        "untouched": None,
        "kept": ["turned 3-9"],
        "overlaid": ["something lies over it 20-31"],
        "mark_found": bool(place),
        "label": bool(place),
        "signed": not place,
        "film_credentials": "",
        "mark": None if place else "0123456789abcdef",
    }


def found(*dubs: tuple[str, str, float]) -> dict[str, Any]:
    entries = {name: dub_of(name, verdict, k, c) for k, (name, verdict, c) in enumerate(dubs)}
    verdicts = [entry["verdict"] for entry in entries.values()]
    consent = {"by": "Ann", "reference": "form", "date": None, "languages": ["it"]}
    person: dict[str, Any] = {
        "state": "made",
        "failure": None,
        "stages": {},
        "clip": "/films/ann.mp4",
        "consent": consent,
        "warnings": [],
        "learned": in_words([("ann.mp4", [(3.0, 6.0), (21.04, 33.0)], [])]),
        "contact_sheet": "work/sheet.png",
        "loss": [],
        "psnr": [],
        "sync": None,
    }
    return {
        "manifest": "m.yaml",
        "code": 0,
        "seconds": 1.0,
        "peak_memory_mb": 1,
        "machine": {"cores": 2, "system": "x"},
        "warnings": [],
        "identities": {"ann": person},
        "counts": {verdict: verdicts.count(verdict) for verdict in VERDICTS},
        "dubs": entries,
    }


def line(number: int, verdict: str | None) -> dict[str, Any]:
    found = {"line": number, "speaker": "ANN", "identity": "ann", "in": f"01:00:0{number}:00"}
    return {
        **found,
        "cue": f"ann_{number}",
        "told": f"told {number}",
        "seconds": 1.5,
        "in_frame": 37,
        "out_frame": 60,
        "words": "a <b>",
        "verdict": verdict,
        "reason": "",
        "loudness": -23.0,
        "own_pixels": "covered 40-44" if number == 1 else "",
        "overlaid": "45-60" if number == 1 else "",
        "edit": "",
        "note": "",
        "status": "open",
        "take": "late",
        "takes": [
            {"take": "", "made": False, "verdict": None, "offset_ms": None, "closeness": None},
            {"take": "late", "made": True, "verdict": "pass", "offset_ms": 40, "closeness": 0.9},
        ],
        "reach": "80 % of the frames dubbed" if number == 1 else "all frames dubbed",
        "short": number == 1,
    }


def shown_everything() -> dict[str, Any]:
    """A scene with lines, a dub without a video, a second person, and long words."""
    data = found(*DUBS)
    dubs, people = data["dubs"], data["identities"]
    for dub in dubs.values():
        dub["source"] = SOURCE
    dubs["still"] |= {
        "lines": [line(1, "pass"), line(2, "warn") | {"seconds": 0.5, "words": "w" * 90}],
        "line_counts": {"pass": 1, "warn": 1},
    }
    dubs["gone"]["video"] = None
    dubs["gone"]["failure"] |= {"where": f"/films/{'x' * 90}", "trace": "y" * 200}
    dubs["quiet"]["identity"] = "ann, Bob"
    people["Bob"] = people["ann"] | {"clip": f"/films/{'bob' * 30}.mp4"}
    return data


def write_everything(place: Path) -> Path:
    """The page of `shown_everything` beside all that it shows: ten seconds a dub."""
    data, folder = shown_everything(), place / "out"
    for made in (folder / "work", place / "clips"):
        made.mkdir(parents=True)
    (folder / "work" / "sheet.png").touch()
    clips.write_clip(place / "ann.mp4", 300).rename(folder / SOURCE)
    clip = clips.write_clip(place / "dub.mp4", 250)
    for dub in data["dubs"].values():
        if dub["video"]:
            shutil.copy(clip, folder / dub["video"])
    page = folder / "report.html"
    page.write_text(page_of(data), encoding="utf-8")
    return page
