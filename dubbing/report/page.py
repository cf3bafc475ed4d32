"""The page of a report: one file, which needs no network and no server."""

import math
import re
from pathlib import Path
from typing import Any

from dubbing import design
from dubbing.design.filled import filled
from dubbing.printable import visible

MOST_POINTS = 400  # of a curve on the page
# Verdicts of dubs, the worst first, and what the page calls them.
FAILED, WARNED, PASSED, UNJUDGED, MISSING = "failed", "warned", "passed", "unjudged", "missing"
VERDICTS = (FAILED, WARNED, UNJUDGED, MISSING, PASSED)
WORDS = {
    PASSED: "in sync",
    WARNED: "to look at",
    FAILED: "failed",
    UNJUDGED: "not judged",
    MISSING: "not made",
}
LINKS = ("video", "source", "thumbnail", "contact_sheet")
FOLDERS = re.compile(r"(?<![\w./:])/(?:[^\s/:]+/)+")  # of an absolute path


def page_of(found: dict[str, Any]) -> str:
    """The HTML of what `report.collect` found."""
    own = Path(__file__)
    parts = {
        "style": _text(design.CURVE_STYLE) + _text(design.STYLE),
        "curves": _text(design.CURVES),
        "script": own.with_name("page.js").read_text(encoding="utf-8"),
    }
    return filled(own.with_name("page.html"), portable(found), parts, first_line=first_line(found))


def first_line(found: dict[str, Any]) -> str:
    """The count of dubs by verdict: ``3 dubs: 2 in sync, 1 to look at``."""
    counts = found["counts"]
    total = sum(counts.values())
    words = [f"{counts[v]} {WORDS[v]}" for v in (PASSED, WARNED, *VERDICTS) if counts[v]]
    dubs = f"{total} dub{'' if total == 1 else 's'}"
    return f"{dubs}: {', '.join(dict.fromkeys(words))}" if words else dubs


def portable(value: Any, key: str = "") -> Any:
    """Data as a page may hold it: no control characters, folders of this machine or infinities."""
    if isinstance(value, dict):
        return {name: portable(one, str(name)) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [portable(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, str):
        return value if key in LINKS else visible(FOLDERS.sub("", value))
    return value


def _text(name: str) -> str:
    return (design.FOLDER / name).read_text(encoding="utf-8")
