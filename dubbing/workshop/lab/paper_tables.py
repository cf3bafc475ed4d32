"""The tables of docs/development/paper.md: three of the paper's, on people whom no base knew.

Table 1 compares numbers of references, table 2 lengths of what is learned, table 3 models with and
without the warp. What was measured is not measured again, so a run that was killed goes on.
"""

from __future__ import annotations

import argparse
import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dubbing.engine.disk.files import atomic_write_text
from dubbing.errors import ExplainedError
from dubbing.manifest.checks.preset_checks import base_header
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from dubbing.workshop.lab.evaluation import Figures, Progress
from dubbing.workshop.lab.result_tables import P15, P15X, table
from dubbing.workshop.lab.results import (
    Request,
    conditions,
    figures_of,
    filled,
    measure_seeds,
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
LEFT_OUT = ("flicker", "haarpsi", "sharpness_eyes", "chin_ratio", "old_chin_ratio", "texture_ratio")
MORE = ("offset", "offset_frames", 1), ("learned in, s", "seconds", 0)
PICTURES, DUBS = (
    tuple(column for column in columns if column[1] not in LEFT_OUT) + MORE
    for columns in (P15, P15X)
)


@dataclass(frozen=True)
class Row:
    """A method and how long it learns, in one or several of the tables."""

    variant: Variant
    seconds: float

    def __str__(self) -> str:
        return f"{self.variant}, {self.seconds:g} s"


def rows_of_tables(bases: Mapping[str, Path]) -> dict[str, list[Row]]:
    """The rows of each table by its title.

    Args:
        bases: of methods, in place of the shipped one.
    """

    def variant(method: str, references: int = USUAL, warp: bool = True) -> Variant:
        return Variant(method, references, warp, bases.get(method))

    lengths = [*map(variant, METHODS), *map(Variant, OTHERS)]
    return {
        "Table 1, references": [Row(variant(m, n), LENGTH) for m in METHODS for n in REFERENCES],
        "Table 2, lengths": [Row(one, seconds) for one in lengths for seconds in LENGTHS],
        "Table 3, the warp": [
            Row(variant(m, warp=w), LENGTH) for m in METHODS for w in (True, False)
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


def check_bases(production: Production, bases: Mapping[str, Path]) -> None:
    """Refuses bases that cannot be compared.

    Raises:
        ExplainedError: of an unknown method, none where no base is shipped, or one that was learned
            from somebody who is measured.
    """
    for method in bases:
        preset_of(method)
    if "dfrf-paper" not in bases:
        remedy = "train one: dfrf train-base --method dfrf-paper"
        raise ExplainedError("dfrf-paper has no base", "--base", remedy)
    for base in bases.values():
        if known := set(base_header(base).get("identities", ())) & set(production.people):
            who = ", ".join(sorted(known))
            raise ExplainedError(f"learned from {who}, so it cannot be measured there", base.name)


def measure(
    production: Production, rows: Sequence[Row], request: Request, progress: Progress
) -> list[Figures]:
    """Figures of rows of one length by their titles, for each seed."""
    (seconds,) = {row.seconds for row in rows}
    some = {row.variant: str(row) for row in rows}
    prepared = replace(learning(production, LENGTH), people=production.people)
    learned = learning(production, seconds)
    if not learned.people:
        return [{} for _ in request.seeds]
    runs = measure_seeds(
        learned,
        replace(request, methods=tuple(some)),
        progress,
        with_seed(prepared, request.seeds[0]),
    )
    return [
        {name: {some[v]: found[str(v)] for v in some} for name, found in run.items()}
        for run in runs
    ]


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
    for variant in dict.fromkeys(row.variant for rows in tables.values() for row in rows):
        if variant.base is not None and str(variant) == f"{variant.method}-{USUAL}":
            header = base_header(variant.base)
            known = len(header.get("identities", ()))
            lines.append(f"Base of {variant.method}: {header.get('steps')} steps, {known} people.")
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
    parser.add_argument("--base", action="append", default=[], metavar="METHOD=FILE")
    parser.add_argument("--seeds", type=seeds_from, default="0,1,2", help="two or more")
    parser.add_argument("--seconds", type=float, help="as of `dfrf evaluate`; all by default")
    parser.add_argument("--lpips-weights", type=Path, help="as of `dfrf evaluate`")
    parser.add_argument("--device", default="auto")
    parser.add_argument("--commit", default="unknown", help="as the document names it")
    parser.add_argument("--document", type=Path, default=Path("docs/development/paper.md"))
    given = parser.parse_args(arguments)
    how = (1, given.seconds, given.lpips_weights, given.device, given.commit)
    request = Request(given.seeds, (), *how, composition=False)
    bases = {method: Path(file) for method, _, file in (b.partition("=") for b in given.base)}
    tables = rows_of_tables(bases)
    runs: list[Figures] = [{} for _ in given.seeds]
    try:
        text = given.document.read_text(encoding="utf-8")
        document(text, tables, request, runs, datetime.date.min)  # before hours of work
        production = load(given.manifest)
        check_bases(production, bases)
        for seconds in sorted(LENGTHS, key=lambda one: one != LENGTH):
            rows = [row for rows in tables.values() for row in rows if row.seconds == seconds]
            for run, more in zip(runs, measure(production, rows, request, printer()), strict=True):
                for name, found in more.items():
                    run.setdefault(name, {}).update(found)
            done = document(text, tables, request, runs, datetime.date.today())
            atomic_write_text(given.document, done)
    except (OSError, ValueError, ExplainedError) as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
