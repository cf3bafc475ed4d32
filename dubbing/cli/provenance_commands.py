"""`dfrf verify`: what a file carries, and `dfrf consent`: a form to fill in."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from dubbing.printable import visible

NOTHING_FOUND = 1


def verify(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", exists=True, dir_okay=False, help="Any video.")
    ],
    key: Annotated[
        list[Path] | None,
        typer.Option(
            "--key",
            exists=True,
            dir_okay=False,
            help="A key of the invisible mark, beside this installation's; may be repeated.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what a video carries: credentials, invisible mark, metadata. Exit code 1: nothing."""
    from dubbing.provenance import verify as work
    from dubbing.provenance.mark_key import installation_file

    own = installation_file()
    keys = [*(key or ()), *([own] if own.exists() else [])]
    found = work.verify(file, list(dict.fromkeys(keys)))
    if as_json:
        typer.echo(json.dumps(found.to_json(), indent=2))
    else:
        for line in work.sentences(found):
            typer.echo(visible(line))
    if not found.found:
        raise typer.Exit(NOTHING_FOUND)
