"""Commands of a job: `dub`, `plan`, `init`, `schema`, `demo`."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubbing import packages
from dubbing.cli.arguments import (
    AsJson,
    Device,
    Force,
    ManifestPath,
    Only,
    checked_device,
    checked_path,
    checked_stages,
    print_line,
)
from dubbing.errors import CallError

if TYPE_CHECKING:
    from dubbing.engine.executors import Executor

WITHOUT_DUBS = "the manifest has no dubs, so nothing would be made"


def dub(
    manifest: ManifestPath,
    only: Only = None,
    force: Force = None,
    device: Device = "auto",
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Processes at a time.")] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS|FILE",
            help="Address or scheduler file of Dask, whose workers do the work.",
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

    options, loaded = (
        Options(force=checked_stages(force), keep_going=keep_going),
        load(manifest, from_base=True),
    )
    if not loaded.dubs:
        raise CallError(WITHOUT_DUBS, str(loaded.path), "name new speech for somebody there")
    source = Source(loaded.path, checked_device(device, here=scheduler is None))
    if scheduler:
        from dubbing.engine.cluster import Cluster

        executor: Executor = Cluster(source, scheduler)
    else:
        executor = Processes(source, jobs) if jobs > 1 else InLine()
    left = batch.time_left(
        loaded, options, only=tuple(only or ()), workers=jobs, parts=bool(scheduler) or jobs > 1
    )
    shown = live.JsonLines if as_json else live.Bars
    reporter: live.JsonLines | live.Bars = shown(loaded.warnings, left)
    with closing(executor), reporter:
        result = batch.dub(
            loaded, reporter, options, only=tuple(only or ()), device=device, executor=executor
        )
    (console.result_line if as_json else console.summary)(result)
    raise typer.Exit(result.code)


def plan(
    manifest: ManifestPath, only: Only = None, force: Force = None, as_json: AsJson = False
) -> None:
    """Check a manifest and its files, and print what would run, why, and how long it takes.

    Writes nothing.
    """
    from dubbing.batch import estimates, jobs, results
    from dubbing.cli import console
    from dubbing.engine import planner as planning
    from dubbing.identity.learned import learned_if_known
    from dubbing.manifest.manifest import load
    from dubbing.report.lines import undubbed_of
    from dubbing.report.report import found_by_looks

    loaded = load(manifest, from_base=True)
    planned = jobs.build(loaded, only=tuple(only or ()))
    results.check(loaded, planned.dubs)
    rows = planning.rows(planned, checked_stages(force))
    again = [row.job.name for row in rows if row.stage == "composite" and row.state != "up to date"]
    absent = packages.missing()
    warnings = [*loaded.warnings, *results.warnings(loaded, again), *found_by_looks(planned)]
    warnings += [] if loaded.dubs else [f"{WITHOUT_DUBS}: dfrf dub refuses it"]
    warnings += [str(packages.lacking(absent))] if absent else []
    learned = {
        name: clips
        for name, job in planned.identities.items()
        if (clips := learned_if_known(job.stages["finetune"].folder))
    }
    undubbed = {name: undubbed_of(loaded, name) for name in planned.dubs}
    needed = estimates.estimate(loaded, planned, rows)
    console.plan(rows, warnings, needed, learned, undubbed, as_json=as_json)


def init(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", exists=True, file_okay=False, help="Folder of clips and recordings."
        ),
    ],
) -> None:
    """Write FOLDER/manifest.yaml from the clips and recordings found there."""
    from dubbing.manifest.init import write_manifest

    written = write_manifest(folder, print_line)
    print_line(f"wrote {written}; fill in who gave consent, then run: dfrf plan {written}")


def schema() -> None:
    """Print the JSON Schema of a manifest, by which an editor completes and checks its keys."""
    from dubbing.manifest import schema as work

    typer.echo(work.text(), nl=False)


def demo(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", file_okay=False, help="Folder to work in.")
    ] = Path("out/demo"),
) -> None:
    """Make a synthetic speaker in a folder, and dub it into Italian and German."""
    packages.require("synthetic")
    from dubbing.workshop.synthetic.demo import write_demo

    dub(write_demo(checked_path(folder)))
