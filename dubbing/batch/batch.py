"""One run: every dub of a manifest brought up to date, published and reported."""

import shutil
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from dubbing import pipeline
from dubbing.batch import estimates, jobs, results
from dubbing.batch.results import Ledger
from dubbing.batch.time_left import TimeLeft
from dubbing.engine import claims, planner, runner
from dubbing.engine.executors import Executor
from dubbing.engine.graph import Job, Jobs, kind_of
from dubbing.engine.outcome import Outcome, Reporter, failure_of
from dubbing.engine.runner import Options
from dubbing.errors import DubbingError
from dubbing.files import make_folder
from dubbing.manifest.manifest import Manifest
from dubbing.manifest.overwriting import REPORTS
from dubbing.provenance.mark_key import make_installation_key
from dubbing.report import lines, report
from dubbing.report.report import Sync
from dubbing.stages.kinds import PROXY_FILE, SYNC_FILE

DEFAULT = Options()
RESULTS = "results"  # claimed while they are put into the output folder
ALL_MADE, SOME_FAILED, SYNC_FELL_SHORT = 0, 1, 3


@dataclass(frozen=True)
class Result:
    """What a run left behind.

    Attributes:
        outcomes: by ``kind/name``.
        report: its page, or why there is none.
        syncs: dub -> its check.
    """

    outcomes: dict[str, Outcome]
    code: int
    report: Path | DubbingError
    syncs: dict[str, Sync]


def dub(
    manifest: Manifest,
    reporter: Reporter,
    options: Options = DEFAULT,
    *,
    only: tuple[str, ...] = (),
    device: str = "auto",
    executor: Executor | None = None,
) -> Result:
    """Make every dub of a manifest that is not up to date, and the report.

    Other runs may work in the same output: each stage is made by one of them.

    Args:
        executor: where the stages are done; one after another in this process by default.

    Raises:
        ManifestError: a file that is not of this manifest would be replaced.
        DubbingError: ``only`` names nothing, or nothing can be written.
    """
    if any(dub.mark is not None and dub.mark.key is None for dub in manifest.dubs):
        make_installation_key()
    planned = jobs.build(manifest, only=only, device=device)
    results.check(manifest, planned.dubs)
    make_folder(manifest.work)
    with claims.hold(manifest.work / RESULTS, wait=True):
        results.ledger_of(manifest).keep()  # as it is before anything is made
    started = time.perf_counter()
    if adopt_renamed(manifest, planned):
        planned = jobs.build(manifest, only=only, device=device)
    outcomes = runner.run(planned, options, reporter, executor)
    every = (*planned.identities.values(), *planned.dubs.values())
    for folder in {stage.folder.parent for job in every for stage in job.stages.values()}:
        claims.sweep(folder)
    with claims.hold(manifest.work / RESULTS, wait=True):
        ledger = results.ledger_of(manifest)
        for job in planned.dubs.values():
            outcome = outcomes[job.label]
            if outcome.state in ("made", "kept"):
                try:
                    publish(manifest, job, ledger)
                    remove_old_cues(job)
                except (DubbingError, OSError) as error:
                    outcome.state, outcome.failure = "failed", failure_of("publish", error)
        syncs = {name: report.sync_of(job) for name, job in planned.dubs.items()}
        code = exit_code(outcomes, syncs)
        seconds = time.perf_counter() - started
        written: Path | DubbingError
        try:
            everything = jobs.build(manifest)
            ledger.enter(dict.fromkeys(REPORTS, ""))
            written = report.write(manifest, everything, outcomes, code=code, seconds=seconds)
        except DubbingError as error:  # the outcomes of the jobs are reported nevertheless
            written, code = error, SOME_FAILED
    return Result(outcomes, code, written, syncs)


def time_left(
    manifest: Manifest, options: Options, *, only: tuple[str, ...], workers: int, parts: bool
) -> TimeLeft:
    """How long a run of `dub` takes, before it begins; it tells while it goes on.

    Args:
        workers: stages that are made at once.
        parts: whether they are made in parts.
    """
    planned = jobs.build(manifest, only=only)
    rows = planner.rows(planned, options.force)
    wanted = {f"{row.job.label}/{row.stage}" for row in rows if row.state in ("run", "after")}
    expected = {
        key: seconds
        for key, seconds in estimates.expected(manifest, planned, parts=parts).items()
        if key in wanted or key.rpartition(" ")[0] in wanted
    }
    return TimeLeft(expected, kind_of, time.monotonic, workers)


def adopt_renamed(manifest: Manifest, planned: Jobs) -> bool:
    """Gives folders of dubs that were renamed their new names. True if there were any."""
    moves = {
        job.stages["composite"].folder.parent: pipeline.dub_folder(manifest, name)
        for name, job in planned.dubs.items()
        if job.stages
    }
    renamed = {folder: named for folder, named in moves.items() if folder != named}
    for folder, named in renamed.items():
        if not any(folder.rglob(f"*{claims.SUFFIX}")):  # another run is at work in it
            with suppress(FileNotFoundError):  # another run was quicker
                folder.rename(named)
    return bool(renamed)


def publish(manifest: Manifest, job: Job, ledger: Ledger) -> None:
    """Put a dub, its sync check and its lines into the output folder, under the dub's name.

    Raises:
        DubbingError: nothing can be written there, or a file there is not ours.
    """
    dub = next(dub for dub in manifest.dubs if dub.name == job.name)
    made = job.stages["composite"].folder
    files = {
        "video": pipeline.finished(job, dub),
        "sync": job.stages["check"].folder / SYNC_FILE,
        "proxy": made / PROXY_FILE,
    }
    rows = lines.lines_of(manifest, dub, job)
    texts = {}
    if rows:
        texts = {
            "lines.csv": lines.as_csv(rows),
            "lines.jsonl": lines.as_json_lines(rows),
            "edl": lines.as_edl(manifest, dub, rows),
        }
    results.put(ledger, dub, files, texts)


def remove_old_cues(job: Job) -> None:
    """Remove what was made for lines that are spoken at other times now, or not at all."""
    cues = job.stages["composite"].folder.parent / pipeline.CUES
    present = {stage.folder.parent for stage in job.stages.values()}
    for folder in cues.iterdir() if cues.is_dir() else ():
        # One with a claim in it is of another run.
        if folder not in present and not any(folder.glob(f"*{claims.SUFFIX}")):
            shutil.rmtree(folder)


def exit_code(outcomes: dict[str, Outcome], syncs: dict[str, Sync]) -> int:
    """0 all made; 1 a job failed; 3 all made, but a sync check fell short."""
    if any(outcome.state in ("failed", "skipped", "stopped") for outcome in outcomes.values()):
        return SOME_FAILED
    fell_short = any(sync.get("verdict") == "fail" for sync in syncs.values())
    return SYNC_FELL_SHORT if fell_short else ALL_MADE
