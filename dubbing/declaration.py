"""The stages of one job as they are declared: where each lies, and what it depends on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dubbing.engine.code_version import code_version
from dubbing.engine.stage import Produce, Stage
from dubbing.stage_kinds import KINDS


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
        reads: Mapping[str, Path | Stage],
        parameters: Mapping[str, Any] | None = None,
        of: str = "",
        parts: Mapping[str, Produce] | None = None,
    ) -> Stage:
        """Declares the next stage: who does it, what it reads, and what else it depends on.

        Args:
            of: which one it is, where a job has several of a kind.
            parts: see `Stage`.
        """
        kind = KINDS[name]
        folder, version = (
            self.folder / self.parts / of if of else self.folder,
            code_version(kind.module),
        )
        stage = Stage(
            name, folder / kind.folder, version, parameters or {}, reads, task, parts or {}
        )
        self.declared[f"{name} {of}" if of else name] = stage
        return stage
