"""How the time of a dub grows with the length of the speech, the head crop, people and cores.

    python -m dubbing.workshop.bench.growth CLIP SPEECH OUT

CLIP shows one person, who may say SPEECH, as for `dub_times`. OUT is a new folder. Each call is a
process of its own. Alone on the machine; it takes some fifteen minutes on two cores.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import typer

from dubbing.workshop.bench.dub_times import dubbed, manifest

LENGTHS = (2.5, 5.0, 10.0)  # s of speech
SIZES = (128, 256, 512)  # px
PEOPLE = 2
SHORT, SMALL = LENGTHS[0], SIZES[1]  # of all but what is varied


@dataclass(frozen=True)
class Row:
    """Seconds by the clock of a dub, or of several, for each value of what is varied."""

    varied: str
    values: Sequence[float]
    seconds: Sequence[float]


def growth(clip: Path, speech: Path, out: Path) -> list[Row]:
    """The rows of the table; a person is learned before lengths are compared."""
    out.mkdir(parents=True)

    def first(name: str, *options: str, size: int = SMALL, people: int = 1) -> float:
        made = manifest(clip, speech, out / name, lengths=[SHORT], size=size, people=people)
        return dubbed(out / f"{name}.yaml", made, *options)

    sizes = [first(f"size{size}", size=size) for size in SIZES]
    one, known = out / "known.yaml", out / f"size{SMALL}"
    lengths = []
    for k in range(1, len(LENGTHS) + 1):
        plan = manifest(clip, speech, known, lengths=LENGTHS[:k], size=SMALL)
        plan["dubs"] = [{**dub, "name": f"again_{dub['name']}"} for dub in plan["dubs"]]
        lengths.append(dubbed(one, plan))
    people = [sizes[SIZES.index(SMALL)], first("people", people=PEOPLE)]
    cores = [people[1], first("jobs", "--jobs", "2", people=PEOPLE)]
    return [
        Row("head crop, px: a first dub", SIZES, sizes),
        Row("s of speech: a second dub", LENGTHS, lengths),
        Row("people: first dubs", (1, PEOPLE), people),
        Row("`--jobs`: first dubs of two people", (1, 2), cores),
    ]


def table(rows: Sequence[Row]) -> str:
    """The rows as a table in Markdown."""
    lines = [
        f"| {row.varied} | {', '.join(f'{value:g}' for value in row.values)} | "
        f"{', '.join(f'{spent:.1f}' for spent in row.seconds)} |"
        for row in rows
    ]
    return "\n".join(["| with | values | seconds |", "|---|---|---|", *lines])


def main(clip: Path, speech: Path, out: Path) -> None:
    """Prints the table."""
    if out.exists():
        raise typer.BadParameter(f"{out} exists: name a new folder")
    print(table(growth(clip.resolve(), speech.resolve(), out.resolve())))


if __name__ == "__main__":
    typer.run(main)
