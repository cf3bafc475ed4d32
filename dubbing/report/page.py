"""The page of a report: one file, which needs no network."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from dubbing.printable import visible

MOST_POINTS = 400  # of a curve on the page
WIDTH, HEIGHT = 320, 80  # of its drawing, as in page.html
# Verdicts of dubs, the worst first.
FAILED, WARNED, PASSED, UNJUDGED, MISSING = "failed", "warned", "passed", "unjudged", "missing"
VERDICTS = (FAILED, WARNED, UNJUDGED, MISSING, PASSED)


def page_of(found: dict[str, Any]) -> str:
    """The HTML of what `report.collect` found."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, finalize=_printable
    )
    environment.filters |= {"curve": curve, "worst_first": worst_first}
    template = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    return environment.from_string(template).render(
        found, first_line=first_line(found), in_table=in_table
    )


def first_line(found: dict[str, Any]) -> str:
    """How many dubs passed, warned and failed: ``3 dubs: 2 passed, 1 warned, 0 failed``."""
    counts = found["counts"]
    named = [PASSED, WARNED, FAILED, *(v for v in (UNJUDGED, MISSING) if counts[v])]
    total = sum(counts.values())
    words = ", ".join(f"{counts[verdict]} {verdict}" for verdict in named)
    return f"{total} dub{'' if total == 1 else 's'}: {words}"


def in_table(dub: dict[str, Any]) -> bool:
    """Whether the page has a table of a dub's lines: not of one recording, which has no words."""
    return len(dub["lines"]) > 1 or any(line["words"] for line in dub["lines"])


def worst_first(dubs: dict[str, Any]) -> list[tuple[str, Any]]:
    """Names and dubs by verdict; of one verdict, those first that are least like their film."""

    def rank(item: tuple[str, Any]) -> tuple[int, float]:
        sync = item[1]["sync"] or {}
        return VERDICTS.index(item[1]["verdict"]), sync.get("closeness") or 0.0

    return sorted(dubs.items(), key=rank)


def curve(values: Sequence[float]) -> str:
    """Points of an SVG polyline through finite ``values``, low values at the bottom."""
    step = max(1, len(values) // MOST_POINTS)
    finite = [v for v in values[::step] if math.isfinite(v)]
    if len(finite) < 2:
        return ""
    low, high = min(finite), max(finite)
    across, up = WIDTH / (len(finite) - 1), HEIGHT / ((high - low) or 1)
    return " ".join(f"{k * across:.1f},{(high - v) * up:.1f}" for k, v in enumerate(finite))


def _printable(value: Any) -> Any:
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value
