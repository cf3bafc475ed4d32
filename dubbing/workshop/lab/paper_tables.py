"""The tables of docs/development/paper.md: three of the paper's, on people whom no base knew.

Table 1 compares numbers of references, table 2 lengths of what is learned, table 3 models with and
without the warp. Table 4 goes from AD-NeRF to what a dub uses. The figures of each seed lie beside
the document, in a file of its name that ends in .json. What stands there is not measured again, on
whatever machine it was measured, unless the clip, the settings or the weights are others.
"""

from __future__ import annotations

import argparse
import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dubbing.engine.disk import claims
from dubbing.engine.disk import json_records as kept
from dubbing.engine.disk.files import atomic_write_json, atomic_write_text
from dubbing.errors import ExplainedError
from dubbing.manifest.checks.preset_checks import base_header
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from dubbing.shipped.base import shipped_base
from dubbing.workshop.lab.evaluation import EVALUATION, Figures, Progress
from dubbing.workshop.lab.result_tables import P15, P15X, table
from dubbing.workshop.lab.results import (
    Request,
    conditions,
    figures_of,
    filled,
    how,
    measure_seed,
    printer,
    seeds_from,
    with_seed,
)
from dubbing.workshop.lab.variants import Variant, preset_of

MARKS = "<!-- made by `make paper-tables` -->", "<!-- end of what `make paper-tables` made -->"
METHODS = ("dfrf-paper", "dfrf-nocrops")
OTHERS = ("nerf", "ad-nerf-nolips")  # that the paper compares in its table of lengths
REFERENCES, USUAL = (1, 2, 4, 6), 4
LENGTHS, LENGTH = (10.0, 15.0, 20.0), 15.0  # learned, seconds
HELD_OUT = 3.0  # seconds that a clip has beside them, at least
MADE = "made of"  # a digest, among the figures of a row
LEFT_OUT = ("flicker", "haarpsi", "sharpness_eyes", "chin_ratio", "old_chin_ratio", "texture_ratio")
OFFSET = ("offset", "offset_frames", 1)
PICTURES, DUBS = (
    (*(column for column in columns if column[1] not in LEFT_OUT), OFFSET)
    for columns in (P15, P15X)
)


@dataclass(frozen=True)
class Row:
    """A method and how long it learns, in one or several of the tables."""

    variant: Variant
    seconds: float

    def __str__(self) -> str:
        return f"{self.variant}, {self.seconds:g} s"


def rows_of_tables() -> dict[str, list[Row]]:
    """The rows of each table by its title."""
    lengths = [*(Variant(method, USUAL) for method in METHODS), *map(Variant, OTHERS)]
    return {
        "Table 1, references": [Row(Variant(m, n), LENGTH) for m in METHODS for n in REFERENCES],
        "Table 2, lengths": [Row(one, seconds) for one in lengths for seconds in LENGTHS],
        "Table 3, the warp": [
            Row(Variant(m, USUAL, w), LENGTH) for m in METHODS for w in (True, False)
        ],
        "Table 4, from AD-NeRF to a dub": [
            Row(one, LENGTH) for one in (Variant(OTHERS[-1]), *lengths[:2], Variant("dfrf"))
        ],
    }


def learning(production: Production, seconds: float) -> Production:
    """The people of long enough clips, learned from so many seconds, in a folder of their own."""
    people = {
        name: replace(person, seconds=seconds)
        for name, person in production.people.items()
        if person.clip.frames >= ((person.start or 0.0) + seconds + HELD_OUT) * person.clip.rate
    }
    return replace(production, output=production.output / f"learned-{seconds:g}", people=people)


def check_bases(production: Production) -> None:
    """Refuses people from whom one of the bases was learned.

    Raises:
        ExplainedError: there is such a one.
    """
    for base in map(_base_of, METHODS):
        if known := set(base_header(base).get("identities", ())) & set(production.people):
            who = ", ".join(sorted(known))
            raise ExplainedError(f"learned from {who}, so it cannot be measured there", base.name)


def _base_of(method: str) -> Path:
    base = shipped_base(preset_of(method))
    if base is None:
        raise ExplainedError(f"no base of {method} comes with this tool")
    return base


def measure(
    production: Production,
    row: Row,
    seed: int,
    request: Request,
    run: Figures,
    progress: Progress,
) -> bool:
    """Adds the figures of a row, under its title, to those of a seed: who is not up to date there.

    Returns:
        Whether anybody was measured.
    """
    prepared = replace(learning(production, LENGTH), people=production.people)
    first = with_seed(prepared, request.seeds[0])
    learned = with_seed(learning(production, row.seconds), seed)
    asked, title = replace(request, methods=(row.variant,)), str(row)
    made = {name: how(learned, name, row.variant, asked) for name in learned.people}
    stale = {
        name: person
        for name, person in learned.people.items()
        if run.get(name, {}).get(title, {}).get(MADE) != made[name]
    }
    if stale:
        found = measure_seed(replace(learned, people=stale), first, asked, progress)
        for name, (figures,) in ((name, one.values()) for name, one in found.items()):
            run.setdefault(name, {})[title] = {**figures, MADE: made[name]}
    return bool(stale)


def document(
    text: str,
    tables: Mapping[str, Sequence[Row]],
    request: Request,
    runs: Sequence[Figures],
    today: datetime.date,
) -> str:
    """A document whose part between the marks holds the tables, and how they were made.

    Raises:
        ExplainedError: it has no such part.
    """
    lines = conditions(request, today)
    for method in METHODS:
        header = base_header(_base_of(method))
        known = len(header.get("identities", ()))
        lines.append(f"Base of {method}: {header.get('steps')} steps, {known} people.")
    for title, rows in tables.items():
        names = [str(row) for row in rows]
        own = [
            {name: {m: found[m] for m in names if m in found} for name, found in run.items()}
            for run in runs
        ]
        lines += ["", f"**{title}**, P15:", "", *table(PICTURES, own)]
        lines += ["", f"**{title}**, P15x:", "", *table(DUBS, figures_of("p15x", own))]
    return filled(text, MARKS, lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measures every length, and writes the tables after each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("manifest", type=Path, metavar="MANIFEST")
    parser.add_argument("--seeds", type=seeds_from, default="0,1,2", help="two or more")
    parser.add_argument("--seconds", type=float, help="as of `dfrf evaluate`; all by default")
    parser.add_argument("--lpips-weights", type=Path, help="as of `dfrf evaluate`")
    parser.add_argument("--device", default="auto")
    parser.add_argument("--commit", default="unknown", help="as the document names it")
    parser.add_argument("--document", type=Path, default=Path("docs/development/paper.md"))
    given = parser.parse_args(arguments)
    asked = (1, given.seconds, given.lpips_weights, given.device, given.commit)
    request = Request(given.seeds, (), *asked, composition=False)
    tables, path = rows_of_tables(), given.document.with_suffix(".json")
    rows = {row: None for table in tables.values() for row in table}
    try:
        text = given.document.read_text(encoding="utf-8")
        document(text, tables, request, [{}], datetime.date.min)  # before hours of work
        production = load(given.manifest)
        check_bases(production)
        with claims.hold(production.work / EVALUATION):
            done = kept.read(path, dict[str, Figures], "earlier figures") if path.exists() else {}
            runs = [done.setdefault(str(seed), {}) for seed in given.seeds]
            for row in sorted(rows, key=lambda row: row.seconds != LENGTH):
                for seed, run in zip(given.seeds, runs, strict=True):
                    if measure(production, row, seed, request, run, printer()):
                        atomic_write_json(path, done)
                made = document(text, tables, request, runs, datetime.date.today())
                atomic_write_text(given.document, made)
    except (OSError, ValueError, ExplainedError) as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
