"""One run: every dub of a manifest brought up to date, published and reported."""

import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from dubbing import pipeline
from dubbing.batch import jobs, results
from dubbing.batch.rates import calibrated
from dubbing.batch.results import Ledger
from dubbing.engine.disk import claims
from dubbing.engine.disk.files import atomic_path, writing
from dubbing.engine.graph.graph import Job, Jobs
from dubbing.engine.planning import estimates, planner
from dubbing.engine.planning.time_left import TimeLeft
from dubbing.engine.running import runner
from dubbing.engine.running.executors import Executor
from dubbing.engine.running.outcome import Outcome, Reporter, failure_of
from dubbing.engine.running.runner import Options
from dubbing.errors import ExplainedError
from dubbing.production.dub import Dub
from dubbing.production.production import REPORTS, Production
from dubbing.provenance.mark_key import make_installation_key
from dubbing.report import lines, report, takes
from dubbing.report.findings import Sync, sync_of
from dubbing.script.edl import Marker
from dubbing.stages.check import Check
from dubbing.stages.composite import Composite
from dubbing.stages.draft import Draft
from dubbing.sync.records import SYNC_FILE
from dubbing.timelines import laid_over
from dubbing.video.files import DELIVERED, PROXY_FILE, video_file

DEFAULT = Options()
ALL_MADE, SOME_FAILED, SYNC_FELL_SHORT = 0, 1, 3


@dataclass(frozen=True)
class Result:
    """Outcome of a run.

    Attributes:
        outcomes: by the label of the job.
        report: its page, or why there is none; None of drafts, which have none.
        syncs: dub -> its check.
        drafts: files that were made, or held.
        timelines: that of the manifest with its dubs, or why there is none.
    """

    outcomes: dict[str, Outcome]
    code: int
    report: Path | ExplainedError | None
    syncs: dict[str, Sync]
    drafts: tuple[Path, ...] = ()
    timelines: tuple[Path | ExplainedError, ...] = ()


def dub(
    production: Production,
    planned: Jobs,
    reporter: Reporter,
    options: Options = DEFAULT,
    executor: Executor | None = None,
) -> Result:
    """Make every planned dub that is not up to date, and the report.

    Other runs may work in the same output: each stage is made by one of them.

    Args:
        planned: from `jobs.build`.
        executor: where the stages are done; one after another in this process by default.

    Raises:
        ManifestError: a file that is not of this manifest would be replaced.
        ExplainedError: nothing can be written.
    """
    started = time.perf_counter()
    outcomes = runner.run(planned, options, reporter, executor)
    for folder in {stage.folder.parent for job in planned.all() for stage in job.stages.values()}:
        claims.sweep(folder)
    dubs = planned.named(pipeline.DUB)
    with results.held(production) as ledger:

        def put(name: str, job: Job) -> None:
            publish(production.dubs[name], job, ledger)
            remove_old_cues(production.dubs[name], job)

        put_each(dubs, outcomes, put)
        syncs = {name: sync_of(job) for name, job in dubs.items()}
        code = exit_code(outcomes, syncs)
        seconds = time.perf_counter() - started
        written: Path | ExplainedError
        try:
            everything = jobs.with_others(production, planned)
            ledger.enter(dict.fromkeys(REPORTS, ""))
            written = report.write(production, everything, outcomes, code=code, seconds=seconds)
        except ExplainedError as error:  # the outcomes of the jobs are reported nevertheless
            written, code = error, SOME_FAILED
        timelines = put_timelines(production, planned, ledger)
        if any(isinstance(one, ExplainedError) for one in timelines):
            code = SOME_FAILED
    return Result(outcomes, code, written, syncs, timelines=timelines)


def drafts(
    production: Production,
    planned: Jobs,
    reporter: Reporter,
    options: Options = DEFAULT,
    executor: Executor | None = None,
) -> Result:
    """Make the draft of every planned dub.

    Args:
        planned: from `jobs.build`, with drafts.
        executor: see `dub`.

    Raises:
        ExplainedError: nothing can be written.
    """
    outcomes = runner.run(planned, options, reporter, executor)
    made: list[Path] = []
    with results.held(production) as ledger:

        def put(name: str, job: Job) -> None:
            video = video_file(job.stage(Draft).folder, "h264")
            made.append(results.put_draft(ledger, production.dubs[name], video))

        put_each(planned.named(pipeline.DUB), outcomes, put)
    return Result(outcomes, exit_code(outcomes, {}), None, {}, tuple(made))


def put_each(
    dubs: Mapping[str, Job], outcomes: Mapping[str, Outcome], put: Callable[[str, Job], None]
) -> None:
    """Call `put` with the name and the job of each dub that is there; an error fails that dub."""
    for name, job in dubs.items():
        outcome = outcomes[job.label]
        if outcome.state in ("made", "kept"):
            try:
                put(name, job)
            except (ExplainedError, OSError) as error:
                outcome.state, outcome.failure = "failed", failure_of("publish", error)


def begin(
    production: Production, *, only: tuple[str, ...] = (), device: str = "auto", draft: bool = False
) -> Jobs:
    """The jobs of a run, after a look at its output folder; folders of renamed dubs are renamed.

    Raises:
        ManifestError: a file that is not of this manifest would be replaced.
        ExplainedError: ``only`` names nothing, or nothing can be written.
    """
    if any(dub.marked and dub.mark_key is None for dub in production.dubs.values()):
        make_installation_key()
    results.check(production, jobs.chosen_dubs(production, only))
    with results.held(production) as ledger:
        ledger.keep()  # as it is before anything is made
    return jobs.build(production, only=only, device=device, adopt=not draft, draft=draft)


def time_left(planned: Jobs, options: Options, *, workers: int, parts: bool) -> TimeLeft:
    """Time that a run of `dub` takes, before it begins; it is updated while the run goes on.

    Args:
        workers: stages that are made at once.
        parts: whether they are made in parts.
    """
    wanted = planner.to_do(planner.rows(planned, options.force))
    expected = {
        name: seconds
        for name, seconds in estimates.expected(planned, calibrated(), parts=parts).items()
        if name.whole in wanted
    }
    return TimeLeft(expected, time.monotonic, workers)


def publish(dub: Dub, job: Job, ledger: Ledger) -> None:
    """Put a dub, its sync check and its lines into the output folder, under the dub's name.

    Raises:
        ExplainedError: nothing can be written there, or a file there is not ours.
    """
    files = {
        "video": pipeline.finished_video(job),
        "sync": job.stage(Check).folder / SYNC_FILE,
        "proxy": job.stage(Composite).folder / PROXY_FILE,
    }
    rows = lines.lines_of(dub, job)
    texts = {
        "lines.csv": lines.as_csv(rows),
        "lines.jsonl": lines.as_json_lines(rows),
        "edl": lines.as_edl(dub, job, rows),
    }
    results.put(ledger, dub, files, texts)
    takes.keep(dub, job, rows)
    if dub.settings.deliver != "video":
        results.put_frames(ledger, dub, job.stage(Composite).folder / DELIVERED)


def remove_old_cues(dub: Dub, job: Job) -> None:
    """Remove what was made for lines that are spoken at other times now, or not at all.

    What was made of other takes stays.
    """
    cues = job.folder / job.parts
    present = {cue.name for cue in dub.cues}
    for folder in cues.iterdir() if cues.is_dir() and not dub.length_of_take else ():
        # One with a claim in it is of another run.
        if folder.name not in present and not any(folder.rglob(f"*{claims.SUFFIX}")):
            shutil.rmtree(folder)


def put_timelines(
    production: Production, planned: Jobs, ledger: Ledger
) -> tuple[Path | ExplainedError, ...]:
    """Put the timeline of a manifest, with its dubs, into the output folder; files, or errors."""
    if production.timeline is None:
        return ()
    made = jobs.with_others(production, planned).named(pipeline.DUB)

    def markers(dub: Dub) -> list[Marker]:
        return lines.markers_of(dub, made[dub.name], lines.lines_of(dub, made[dub.name]))

    try:
        wanted = laid_over.files(production, markers)
    except ExplainedError as error:
        return (error,)
    put: list[Path | ExplainedError] = []
    for name, write in wanted.items():
        target = production.output / name
        try:
            results.refuse_others(ledger, name)
            ledger.enter({name: ""})
            with atomic_path(target) as temporary, writing(target):
                write(temporary)
            put.append(target)
        except ExplainedError as error:
            put.append(error)
    return tuple(put)


def exit_code(outcomes: dict[str, Outcome], syncs: dict[str, Sync]) -> int:
    """0 all made; 1 a job failed; 3 all made, but a sync check fell short."""
    if any(outcome.state in ("failed", "skipped", "stopped") for outcome in outcomes.values()):
        return SOME_FAILED
    fell_short = any(sync.get("verdict") == "fail" for sync in syncs.values())
    return SYNC_FELL_SHORT if fell_short else ALL_MADE
