"""Commands of a job: `dub`, `plan`, `init`, `schema`, `demo`."""

from __future__ import annotations

import sys
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
    checked_seconds,
    checked_stages,
    file_option,
    print_line,
)
from dubbing.errors import CallError
from dubbing.homes import keep_findings
from dubbing.printable import visible

if TYPE_CHECKING:
    from dubbing.engine.running.executors import Executor

WITHOUT_DUBS = "the manifest has no dubs, so nothing would be made"


def dub(
    manifest: Annotated[
        Path, typer.Argument(metavar="MANIFEST|CLIP", help="A manifest (YAML), or a film.")
    ],
    speech: Annotated[
        Path | None, typer.Argument(metavar="SPEECH", help="With CLIP: the new speech.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="OUT", help="With CLIP: the video; its manifest is OUT.yaml."
        ),
    ] = None,
    consent: Annotated[
        str,
        typer.Option(metavar='"WHO, WHERE"', help="With CLIP: who agreed, where it is written."),
    ] = "",
    preview: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="With CLIP: only the first, as OUT.preview."),
    ] = None,
    only: Only = None,
    force: Force = None,
    device: Device = "auto",
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS|FILE",
            help="Address or scheduler file of Dask, whose workers do the work.",
        ),
    ] = None,
    keep_going: Annotated[
        bool, typer.Option("--keep-going/--fail-fast", help="Go on with the other jobs.")
    ] = True,
    draft: Annotated[
        bool,
        typer.Option("--draft", help="Make NAME.draft.mp4: half size, visible mark, no check."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make every dub of a manifest that is not up to date; or one, of a film and new speech."""
    if scheduler and jobs > 1:
        raise CallError("the workers are those of the scheduler", "--jobs", "leave it away")
    packages.require("cluster" if scheduler else "")
    keep_findings()
    from dubbing.batch import batch
    from dubbing.batch.task import program
    from dubbing.cli import console, live
    from dubbing.engine.running.executors import InLine
    from dubbing.engine.running.processes import Processes
    from dubbing.engine.running.runner import Options
    from dubbing.manifest import short_call
    from dubbing.manifest.manifest import load

    options = Options(force=checked_stages(force), keep_going=keep_going)
    if speech is None:
        _check_short((output, consent, preview))
        production = load(manifest, from_base=True)
    else:
        if output is None:
            raise CallError("where is the dub to go?", "--output", "as -o OUT.mp4")
        if only:
            raise CallError("there is one dub alone", "--only", "leave it away")
        first = checked_seconds(preview, "--preview")
        with short_call.written(manifest, speech, output, consent, first) as (path, name):
            production, only = load(path, from_base=True), [name]
    if not production.dubs:
        raise CallError(WITHOUT_DUBS, str(production.manifest), "name new speech for somebody")
    worker = program(production.manifest, checked_device(device, here=scheduler is None), draft)
    if scheduler:
        from dubbing.engine.running.cluster import Cluster

        executor: Executor = Cluster(worker, scheduler)
    else:
        executor = Processes(worker, jobs) if jobs > 1 else InLine()
    with closing(executor):
        planned = batch.begin(production, only=tuple(only or ()), device=device, draft=draft)
        parts = bool(scheduler) or jobs > 1
        left = batch.time_left(planned, options, workers=jobs, parts=parts)
        reporter = (live.JsonLines if as_json else live.Bars)(production.warnings, left)
        make = batch.drafts if draft else batch.dub
        with reporter:
            result = make(production, planned, reporter, options, executor)
    (console.result_line if as_json else console.summary)(result)
    raise typer.Exit(result.code)


def _check_short(given: tuple[object, ...]) -> None:
    """Options of the short call have no meaning beside a manifest."""
    for name, value in zip(("--output", "--consent", "--preview"), given, strict=True):
        if value not in (None, ""):
            raise CallError("goes with CLIP SPEECH alone", name, "write it into the manifest")


def plan(
    manifest: ManifestPath, only: Only = None, force: Force = None, as_json: AsJson = False
) -> None:
    """Check a manifest and its files, and print what would run, why, and how long it takes.

    Makes nothing.
    """
    from dubbing.batch import jobs, results
    from dubbing.batch.rates import calibrated
    from dubbing.cli import console
    from dubbing.engine.planning import estimates
    from dubbing.engine.planning import planner as planning
    from dubbing.identity.learned import learned_if_known
    from dubbing.manifest.manifest import load
    from dubbing.pipeline import DUB, PERSON
    from dubbing.report.findings import face_warnings
    from dubbing.report.lines import edits_of, undubbed_of
    from dubbing.report.reach import planned_reach
    from dubbing.stages.composite import Composite
    from dubbing.stages.finetune import Finetune
    from dubbing.timelines import laid_over

    keep_findings()
    production = load(manifest, from_base=True)
    planned = jobs.build(production, only=tuple(only or ()))
    results.check(production, jobs.chosen_dubs(production, tuple(only or ())))
    rows = planning.rows(planned, checked_stages(force))
    again = [
        row.job.name
        for row in rows
        if isinstance(row.stage, Composite) and row.state != planning.UP_TO_DATE
    ]
    absent = packages.missing()
    warnings = [*production.warnings, *results.warnings(production, again)]
    warnings += face_warnings(planned)
    warnings += laid_over.warnings(production)
    warnings += [] if production.dubs else [f"{WITHOUT_DUBS}: dfrf dub refuses it"]
    warnings += [str(packages.lacking(absent))] if absent else []
    learned = {
        name: clips
        for name, job in planned.named(PERSON).items()
        if (clips := learned_if_known(job.stage(Finetune).folder))
    }
    dubs = {name: production.dubs[name] for name in planned.named(DUB)}
    undubbed = {name: undubbed_of(dub) for name, dub in dubs.items()}
    edits = {name: edits_of(dub) for name, dub in dubs.items()}
    needed = estimates.estimate(planned, rows, calibrated())
    reach = planned_reach(production, rows)
    console.plan(rows, warnings, needed, learned, undubbed, edits, reach, as_json=as_json)


def init(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", exists=True, file_okay=False, help="Folder of clips and recordings."
        ),
    ],
    timeline: Annotated[
        Path | None,
        file_option("--timeline", "The cut: EDL, FCPXML, AAF or OTIO; again for a new cut."),
    ] = None,
    handles: Annotated[
        int | None,
        typer.Option(min=0, help="With a timeline: frames beside those of a cut, 8."),
    ] = None,
) -> None:
    """Write FOLDER/manifest.yaml from the clips, recordings and scripts found there.

    Of several clips and one script it shows the faces, and asks who is who.
    """
    from dubbing.manifest.init import write_manifest
    from dubbing.reels import reel_manifest
    from dubbing.timelines import cut_manifest

    ask = _ask if sys.stdin.isatty() and sys.stdout.isatty() else None
    if timeline is not None:
        wanted = cut_manifest.HANDLES if handles is None else handles
        written = cut_manifest.write_manifest(folder, timeline, wanted, print_line, ask)
    elif handles is not None:
        raise CallError("goes with a timeline alone", "--handles", "leave it away")
    else:
        reel = reel_manifest.write_manifest(folder, print_line, ask)
        written = reel or write_manifest(folder, print_line)
    print_line(f"wrote {written}; fill in who gave consent, then run: dfrf plan {written}")


def _ask(question: str) -> str:
    """Ask on the terminal; gives the answer."""
    return str(typer.prompt(visible(question), default="", show_default=False))


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
    packages.require_renderer()
    from dubbing.workshop.synthetic.demo import write_demo

    dub(write_demo(checked_path(folder)))
