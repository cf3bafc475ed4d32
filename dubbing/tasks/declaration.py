"""The stages of one job as they are declared: where each lies, and what it depends on."""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dubbing.engine.code_version import code_version
from dubbing.engine.graph import Job
from dubbing.engine.stage import Produce, Stage
from dubbing.files import same_on_disk
from dubbing.manifest.entries import Identity
from dubbing.stages.kinds import KINDS


class Stages:
    """The stages of one job, in one folder, as they are declared.

    Args:
        parts: name of the folder for those of which there are several.
    """

    def __init__(self, folder: Path, parts: str) -> None:
        self.folder, self.parts = folder, parts
        self.declared: dict[str, Stage] = {}

    def add(
        self,
        name: str,
        task: Produce,
        *,
        reads: Mapping[str, Path | Stage],
        parameters: Mapping[str, Any] | None = None,
        of: str = "",
        parts: Mapping[str, Produce] | None = None,
    ) -> Stage:
        """Declare the next stage: its task, what it reads, and what else it depends on.

        Args:
            of: which one it is, where a job has several of a kind.
            parts: see `Stage`.
        """
        kind = KINDS[name]
        folder = (self.folder / self.parts / of if of else self.folder) / kind.folder
        version = code_version(kind.module)
        stage = Stage(name, folder, version, parameters or {}, reads, task, parts or {})
        self.declared[f"{name} {of}" if of else name] = stage
        return stage


def clip_name(identity: Identity, clip: Path) -> str:
    """Name of a clip in the names of its stages; '' for the one that is learned from.

    Its own name, or where an earlier clip has it already, with the first number that is free. No
    two names are one on a disk that knows no capitals, or only one form of a letter with an accent.
    """
    if clip == identity.clip:
        return ""
    taken: dict[str, Path] = {}
    for film in identity.films:
        names = itertools.chain([film.stem], (f"{film.stem}-{k}" for k in itertools.count(2)))
        name = next(name for name in names if same_on_disk(name) not in taken)
        taken[same_on_disk(name)] = film
        if film == clip:
            return name
    raise ValueError(clip)


def stage_of(person: Job, kind: str, identity: Identity, clip: Path) -> Stage:
    """The stage of a kind that a person has for a clip."""
    return person.stages[f"{kind} {of}" if (of := clip_name(identity, clip)) else kind]
