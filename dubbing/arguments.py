"""Arguments that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dubbing.errors import DubbingError
from dubbing.stage_names import OF_DUB, OF_IDENTITY

FORCEABLE = (*OF_IDENTITY, *OF_DUB)
ManifestPath = Annotated[Path, typer.Argument(metavar="MANIFEST", help="A manifest (YAML).")]
Only = Annotated[
    list[str] | None,
    typer.Option("--only", metavar="NAME", help="This dub or identity only; may be repeated."),
]
Force = Annotated[
    list[str] | None,
    typer.Option("--force", metavar="STAGE", help=f"Do again: {', '.join(FORCEABLE)}."),
]
Device = Annotated[str, typer.Option("--device", help="auto, cpu or cuda.")]


def checked_device(name: str) -> str:
    """The device asked for.

    Raises:
        DubbingError: there is none of that name.
    """
    if name not in ("auto", "cpu", "cuda"):
        raise DubbingError(f"no device {name!r}", "--device", "use auto, cpu or cuda")
    return name
