"""The command line. A body maps its arguments onto one library call and an exit code.

0 all made, no sync check failed; 1 a job failed; 2 the manifest or the call is wrong; 3 all made,
but a sync check failed; 130 interrupted, and resumable. Nothing here imports torch.
"""

from __future__ import annotations

import io
import json
import os
import signal
import sys
from contextlib import closing, suppress
from importlib import metadata
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from dubbing import packages
from dubbing.cli import provenance_commands, research_commands, training_commands
from dubbing.cli.arguments import (
    STAGES,
    Device,
    Force,
    ManifestPath,
    Only,
    checked_device,
    checked_path,
    checked_size,
)
from dubbing.errors import CallError, DubbingError, LockedError, ManifestError
from dubbing.printable import visible

if TYPE_CHECKING:
    from dubbing.engine.executors import Executor

FAILED, WRONG_CALL, INTERRUPTED = 1, 2, 130
WRONG_CALLS = (CallError, LockedError, ManifestError)
ENVIRONMENT = {
    "OMP_WAIT_POLICY": "PASSIVE",  # threads that spin on a shared core cost ten times the work
}

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Dub consenting people on film into another language.",
)

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def _print_version(wanted: bool) -> None:
    if wanted:
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


@app.command()
def dub(
    manifest: ManifestPath,
    only: Only = None,
    force: Force = None,
    device: Device = "auto",
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Processes side by side.")] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS|FILE",
            help="Of Dask, whose workers do the work: its address, or its scheduler file.",
        ),
    ] = None,
    keep_going: Annotated[
        bool, typer.Option("--keep-going/--fail-fast", help="Go on with the other jobs.")
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Make every dub of a manifest that is not up to date."""
    if scheduler and jobs > 1:
        raise CallError("the workers are those of the scheduler", "--jobs", "leave it away")
    packages.require("cluster" if scheduler else None)
    from dubbing.batch import batch
    from dubbing.cli import console, live
    from dubbing.engine.executors import InLine, Processes, Source
    from dubbing.engine.runner import Options
    from dubbing.manifest.manifest import load

    options, loaded = Options(force=_stages(force), keep_going=keep_going), load(manifest)
    source = Source(loaded.path, checked_device(device, here=scheduler is None))
    if scheduler:
        from dubbing.engine.cluster import Cluster

        executor: Executor = Cluster(source, scheduler)
    else:
        executor = Processes(source, jobs) if jobs > 1 else InLine()
    reporter = live.JsonLines(loaded.warnings) if as_json else live.Bars(loaded.warnings)
    with closing(executor), reporter:
        result = batch.dub(
            loaded, reporter, options, only=tuple(only or ()), device=device, executor=executor
        )
    (console.result_line if as_json else console.summary)(result)
    raise typer.Exit(result.code)


@app.command()
def plan(
    manifest: ManifestPath, only: Only = None, force: Force = None, as_json: AsJson = False
) -> None:
    """Check a manifest and its files, and print what would run, why, and how long it takes.

    Writes nothing.
    """
    from dubbing.batch import estimates
    from dubbing.batch.jobs import build
    from dubbing.cli import console
    from dubbing.engine import planner as planning
    from dubbing.identity.learned import learned_if_known
    from dubbing.manifest.manifest import load
    from dubbing.report.report import found_by_looks

    loaded = load(manifest)
    jobs = build(loaded, only=tuple(only or ()))
    rows = planning.rows(jobs, _stages(force))
    gone = packages.missing()
    matched = found_by_looks(jobs)
    warnings = [*loaded.warnings, *matched, *([str(packages.lacking(gone))] if gone else [])]
    learned = {
        name: seconds
        for name, job in jobs.identities.items()
        if (seconds := learned_if_known(job.stages["finetune"].folder))
    }
    needed = estimates.estimate(loaded, jobs, rows)
    console.plan(rows, warnings, needed, learned, as_json=as_json)


@app.command()
def init(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", exists=True, file_okay=False, help="With clips and recordings."
        ),
    ],
) -> None:
    """Write FOLDER/manifest.yaml from the clips and recordings found there."""
    from dubbing.manifest.init import write_manifest

    written = write_manifest(folder)
    print_line(f"wrote {written}; fill in who gave consent, then run: dfrf plan {written}")


@app.command()
def demo(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", file_okay=False, help="To work in.")
    ] = Path("out/demo"),
) -> None:
    """Make a synthetic speaker in a folder, and dub it into Italian and German."""
    packages.require("synthetic")
    from dubbing.synthetic.demo import write_demo

    dub(write_demo(checked_path(folder)))


@app.command()
def prepare(
    clip: Annotated[
        Path,
        typer.Argument(metavar="CLIP", exists=True, dir_okay=False, help="A video of one person."),
    ],
    out: Annotated[
        str | None,
        typer.Option("--out", metavar="PATH", help="Folder; CLIP.prepared if not given."),
    ] = None,
    size: Annotated[int, typer.Option("--size", help="Side of the head crop, pixels.")] = 512,
) -> None:
    """Track, matte and restore the background of one clip; see contact_sheet.png."""
    packages.require()
    from dubbing.cli import live
    from dubbing.preparation.claim import claimed
    from dubbing.preparation.prepare import prepare as work

    size, clip = checked_size(size), checked_path(clip.resolve())
    if out is not None and not out.strip():
        raise DubbingError("names no folder", "--out", "name one, or leave --out away")
    folder = checked_path(Path(out) if out else clip.with_suffix(".prepared"))
    with claimed(folder, clip), live.progress_bar(f"prepare {clip.name}") as progress:
        found = work(clip, folder, size=size, progress=progress)
    for warning in found.warnings:
        print_line(f"warning: {warning}")
    print_line(f"{folder / 'contact_sheet.png'}: residual shift {found.residual_shift:.3f} px")


@app.command()
def sync(
    video: Annotated[
        Path,
        typer.Argument(metavar="VIDEO", exists=True, dir_okay=False, help="Any video with sound."),
    ],
    weights: Annotated[
        Path | None,
        typer.Option(
            "--weights",
            exists=True,
            dir_okay=False,
            help="The published SyncNet (syncnet_v2.model), instead of our network.",
        ),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option(
            "--source",
            metavar="CLIP",
            exists=True,
            dir_okay=False,
            help="What the video was dubbed from: judges it beside this clip, as the report does.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the lip sync of any video: offset, confidence, distance. Exit code 3 on fail."""
    if source and weights:
        raise CallError(
            "judges by our network only", "--source", "leave --source or --weights away"
        )
    packages.require()
    from dubbing.cli import console, live
    from dubbing.sync.check import check
    from dubbing.sync.syncnet.check import published_check

    with live.progress_bar(f"sync {video.name}") as progress:
        if weights is None:
            own = None
            if source is not None:
                own = check(source, progress=lambda share: progress("the source", share))
            found = check(
                video,
                source=own,
                progress=lambda share: progress("listening and looking", share),
            )
        else:
            found = published_check(video, weights)
    if as_json:
        typer.echo(json.dumps(found.to_json(), indent=2))
    else:
        console.sync(found.to_json())
    if found.verdict == "fail":
        raise typer.Exit(3)


app.command()(research_commands.evaluate)
app.command(name="import-checkpoint")(research_commands.import_checkpoint)


@app.command()
def doctor(
    calibrate: Annotated[
        bool,
        typer.Option("--calibrate", help="Measure for `plan` how fast this machine is: a minute."),
    ] = False,
) -> None:
    """What this machine has and lacks, and the command that mends it."""
    from dubbing.cli import console
    from dubbing.cli.doctor import examine

    if calibrate:
        packages.require("synthetic")
        from dubbing.batch import estimates
        from dubbing.cli import live
        from dubbing.lab.calibration import calibrate as work

        with live.progress_bar("calibrate") as progress:
            found = work(progress)
        console.rates(found, estimates.rates_file())
        return
    findings = examine()
    console.doctor(findings)
    raise typer.Exit(int(any(finding.state == "lacking" for finding in findings)))


app.command()(provenance_commands.verify)
app.command()(provenance_commands.consent)
app.command(name="train-base")(training_commands.train_base)
app.command(name="train-speech")(training_commands.train_speech)
app.command(name="train-sync")(training_commands.train_sync)


def main() -> None:
    """Entry point: every user mistake ends in words and an exit code."""
    signal.signal(signal.SIGTERM, _interrupt)
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # what its characters cannot say is written out
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
    except DubbingError as error:
        wrong_call = isinstance(error, WRONG_CALLS) or error.where.startswith("--")
        _end(str(error), WRONG_CALL if wrong_call else FAILED)
    except OSError as error:  # of what is printed, too: `> /dev/full`
        from dubbing.files import system_error

        _end(str(system_error(error)), FAILED)
    except SystemExit as end:
        if end.code == INTERRUPTED:
            _end("interrupted; run the same command again to go on", INTERRUPTED)
        raise


def print_line(text: str, *, err: bool = False) -> None:
    """Print a line, without orders to the terminal."""
    typer.echo(visible(text), err=err)


def _end(text: str, code: int) -> NoReturn:
    """Say why the run ends, if that can be said."""
    with suppress(OSError):
        print_line(f"dfrf: {text}", err=True)
    for stream, original in ((sys.stdout, sys.__stdout__), (sys.stderr, sys.__stderr__)):
        if stream is original and stream is not None:
            # Python tries to write the rest at its end; where that fails, its exit code is 120.
            with suppress(OSError):
                stream.flush()
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(code)


def _interrupt(_signal: int, _frame: FrameType | None) -> Any:
    raise KeyboardInterrupt


def _stages(names: list[str] | None) -> tuple[str, ...]:
    for name in names or ():
        if name not in STAGES:
            raise DubbingError(f"no stage {name!r}", "--force", f"use {', '.join(STAGES)}")
    return tuple(names or ())
