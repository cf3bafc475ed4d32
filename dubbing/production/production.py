"""A production: everything that a manifest asks for, resolved and probed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dubbing.production.dub import Dub
from dubbing.production.person import Person

WORK = "work"  # folder of the stages, in the output folder
REPORTS = ("report.html", "report.json")


@dataclass(frozen=True)
class Production:
    """The people and dubs of a manifest without mistakes.

    Attributes:
        manifest: its file.
        output: folder of the results.
        people, dubs: by name, in the order of the manifest.
        dub_names: of all dubs of the manifest, also of those that were not looked into.
        timeline: the cut that the dubs are of.
    """

    manifest: Path
    output: Path
    people: Mapping[str, Person]
    dubs: Mapping[str, Dub]
    dub_names: frozenset[str]
    warnings: tuple[str, ...] = ()
    timeline: Path | None = None

    @property
    def work(self) -> Path:
        """Where the stages keep their results."""
        return self.output / WORK
