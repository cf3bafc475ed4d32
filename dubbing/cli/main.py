"""The command line: all commands, and how a run ends.

0 all made, no sync check failed; 1 a job failed; 2 the manifest or the call is wrong; 3 all made,
but a sync check failed; 130 interrupted, and resumable. Nothing here imports torch.
"""

import io
import os
import signal
import sys
from contextlib import suppress
from typing import Annotated, NoReturn

import typer

from dubbing.cli import (
    clip_commands,
    job_commands,
    lip_commands,
    machine_commands,
    page_commands,
    provenance_commands,
    research_commands,
    training_commands,
)
from dubbing.cli.arguments import print_line
from dubbing.engine.memory import ROOM, SHORT, short_of_memory
from dubbing.errors import CallError, ExplainedError, LockedError, ManifestError

FAILED, WRONG_CALL, INTERRUPTED = 1, 2, 130
WRONG_CALLS = (CallError, LockedError, ManifestError)
# Threads that spin on a shared core cost ten times the work.
ENVIRONMENT = {"OMP_WAIT_POLICY": "PASSIVE"}

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Dub consenting people on film into another language.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib import metadata

        try:
            print_line(f"dfrf {metadata.version('dfrf')}")
        except metadata.PackageNotFoundError:
            print_line("dfrf, run from its folder without having been installed")
        raise typer.Exit


@app.callback()
def options(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_print_version, help="Print the version."
        ),
    ] = False,
) -> None:
    """Options of no command."""


COMMANDS = {
    "Dubbing": (
        *(job_commands.dub, job_commands.plan, job_commands.init, job_commands.schema),
        *(page_commands.studio, page_commands.share, page_commands.notes),
        *(lip_commands.curves, lip_commands.closures, machine_commands.clean),
        *(job_commands.demo, clip_commands.prepare),
    ),
    "Checking": (
        *(clip_commands.sync, provenance_commands.verify, provenance_commands.consent),
        *(page_commands.rate, machine_commands.doctor),
    ),
    "Research": (research_commands.evaluate, research_commands.import_checkpoint),
    "Training": (
        *(training_commands.train_base, training_commands.train_speech),
        training_commands.train_sync,
    ),
}
for group, commands in COMMANDS.items():
    for command in commands:
        app.command(rich_help_panel=group)(command)


def main() -> None:
    """Entry point: every user mistake ends in words and an exit code."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # characters that it lacks are written out
            stream.reconfigure(errors="backslashreplace")
    try:
        try:
            os.getcwd()
        except FileNotFoundError:
            raise CallError("the current folder is gone", remedy="change to another") from None
        try:
            app()
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except ExplainedError as error:
        wrong_call = isinstance(error, WRONG_CALLS) or error.where.startswith("--")
        _end(str(error), WRONG_CALL if wrong_call else FAILED)
    except (MemoryError, RuntimeError) as error:
        if not short_of_memory(error):
            raise
        _end(str(ExplainedError(SHORT, remedy=ROOM)), FAILED)
    except OSError as error:  # of what is printed, too: `> /dev/full`
        from dubbing.engine.disk.files import system_error

        _end(str(system_error(error)), FAILED)
    except SystemExit as end:
        if end.code == INTERRUPTED:
            _end("interrupted; run the same command again to go on", INTERRUPTED)
        raise


def _end(text: str, code: int) -> NoReturn:
    """Print why the run ends, as far as printing works."""
    with suppress(OSError):
        print_line(f"dfrf: {text}", err=True)
    for stream, original in ((sys.stdout, sys.__stdout__), (sys.stderr, sys.__stderr__)):
        if stream is original and stream is not None:
            # Python tries to write the rest at its end; where that fails, its exit code is 120.
            with suppress(OSError):
                stream.flush()
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(code)
