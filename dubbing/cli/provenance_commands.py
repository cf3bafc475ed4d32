"""`dfrf verify`: what a file carries, and `dfrf consent`: a form to fill in."""

import json
from pathlib import Path
from typing import Annotated

import typer

from dubbing.cli.arguments import AsJson, checked_output, file_argument, file_option, print_line
from dubbing.errors import CallError

FORM = """\
# Consent to a dub, written by `dfrf consent`. Fill in every line, or delete those that shall not
# limit anything (`languages`, `until`, `films`). What is left blank is refused.
#
# "I agree that new speech is put into my mouth in the films named here, with pictures that a
# computer makes of my face, in these languages and until this day. I know that each result is
# marked as made so, and that I can withdraw my consent for everything that is still to be made."
#
# Let the person sign this text, and keep the signed copy where `reference` points. In the manifest:
#     consent: this-file.yaml
# The digest of this file stands in the record of every result.

by:           # first and last name of the person on film
date:         # the day on which they agreed, as 2026-11-02
reference:    # where the signed copy is kept: archive, folder, number
languages: [] # of the new speech, as [it, de, pt-BR]; each dub then names its `language`
until:        # the last day on which dubs may be made, as 2027-11-02
films: []     # files that may be dubbed, as [../clips/host.mp4], or their SHA-256
"""
NOTHING_FOUND = 1


def verify(
    file: Annotated[Path, file_argument("FILE", "Any video.")],
    key: Annotated[
        list[Path] | None,
        file_option("--key", "A key of the invisible mark, beside this machine's; repeatable."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print what a video carries: credentials, invisible mark, metadata.

    Exit code 1: nothing, or credentials that do not hold.
    """
    from dubbing.provenance import verify as work
    from dubbing.provenance.mark_key import installation_file

    own = installation_file()
    keys = [*(key or ()), *([own] if own and own.exists() else [])]
    found = work.verify(file, list(dict.fromkeys(keys)))
    if as_json:
        typer.echo(json.dumps(found.to_json(), indent=2))
    else:
        for line in work.sentences(found):
            print_line(line)
    if not found.found:
        raise typer.Exit(NOTHING_FOUND)


def consent(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The form to write, .yaml.")],
) -> None:
    """Write a form to fill in: who agrees to which dubs, for whom, until when."""
    from dubbing.engine.disk.files import atomic_write_text

    if checked_output(out).exists():
        raise CallError("it is there already; nothing written", str(out), "give another name")
    atomic_write_text(out, FORM)
    print_line(f"wrote {out}; fill it in, then set `consent: {out}` in the manifest")
