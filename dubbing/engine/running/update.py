"""Bringing a stage up to date: under a claim, in a folder of its own, published by a rename."""

import errno
import shutil
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from uuid import uuid4

from ..disk import claims, json_records
from ..disk.claims import TAKEN_OVER, Claim, Watch
from ..disk.files import (
    CHECKSUMS,
    PARTIAL,
    atomic_write_json,
    digest_file,
    patiently,
    remove_damaged,
    sync_file,
    system_error,
)
from ..errors import StageError
from ..graph.part import MARKS, Part
from ..graph.stage import RECORD, Progress, Stage

# Where another process has moved what was to be moved, or has put its own in the place.
OVERTAKEN = (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST)
READY = ".ready-"  # in the name of a folder of finished work that is being put in its place
TEMPORARY = ".*.tmp*"  # names given by files.atomic_path


def run_stage(
    stage: Stage,
    progress: Progress,
    *,
    force: bool = False,
    began: Mapping[Path, str] | None = None,
    wait: bool = True,
) -> bool:
    """Bring a stage up to date. True if there was anything to do.

    Args:
        began: digests of files when the run began, which they must have still.
        wait: for another run that is at work on it.

    Raises:
        ExplainedError: it failed. The last good result and the partial work stay.
        StageError: a file that its results go back to changed; what was made of it is gone.
        LockedError: another run is at work on it.
    """
    with claims.hold(stage.folder, wait=wait) as claim:

        def report(message: str, share: float) -> None:
            claim.note(message, share)
            progress(message, share)

        if isinstance(stage, Part):
            return _fill(stage, report, began or {})
        _await_parts(stage)
        return _update(stage, report, claim, force, began or {})


def _update(
    stage: Stage, progress: Progress, claim: Claim, force: bool, began: Mapping[Path, str]
) -> bool:
    recover(stage)
    if not force and not stage.changes():
        return False
    key, digests, sources = stage.key(), stage.digests(), stage.sources()
    check_unchanged(stage, sources, {**sources, **began})
    partial = stage.partial()
    if force:
        shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True, exist_ok=True)
    for torn in partial.rglob(TEMPORARY):
        torn.unlink()  # half-written files of a run that was killed
    remove_damaged(partial)
    if not _sealed(stage, partial):
        work = replace(stage, last=None if force else stage.whole_result())
        seconds = _produce(work, partial, progress, sources, digests)
        for mark in partial.glob(MARKS):
            seconds += json_records.read(mark, float, "seconds of a part")
            mark.unlink()
        _seal(stage, partial, key=key, digests=digests, seconds=seconds)
    shutil.rmtree(partial / CHECKSUMS, ignore_errors=True)
    claim.check()
    _swap(stage, partial)
    for kind in (PARTIAL, READY):
        for leftover in stage.folder.parent.glob(f"{stage.folder.name}{kind}*"):
            shutil.rmtree(leftover, ignore_errors=True)  # of other settings
    return True


def _fill(part: Part, progress: Progress, began: Mapping[Path, str]) -> bool:
    """Do a part of a stage's work, unless another process is at work on the stage."""
    if not Watch(part.whole.folder).free() or not part.changes():
        return False
    digests, sources, partial = part.digests(), part.sources(), part.partial()
    check_unchanged(part, sources, {**sources, **began})
    partial.mkdir(parents=True, exist_ok=True)
    work = replace(part, last=part.whole_result())
    atomic_write_json(part.mark, _produce(work, partial, progress, sources, digests))
    return True


def _await_parts(stage: Stage) -> None:
    """Wait for the processes that are at work on parts of a stage."""
    for place in stage.folder.parent.glob(f"{stage.folder.name}.*{claims.SUFFIX}"):
        watch = Watch(place.with_name(place.name.removesuffix(claims.SUFFIX)))
        while not watch.free():
            time.sleep(claims.POLL_S)


def _produce(
    stage: Stage,
    partial: Path,
    progress: Progress,
    sources: Mapping[Path, str],
    digests: Mapping[str, str],
) -> float:
    """Do the work; gives the seconds it took. Its sources must not change meanwhile."""
    started = time.perf_counter()
    try:
        stage.run(partial, progress)
    except Exception:
        check_unchanged(stage, stage.sources(), sources, partial)  # its error follows from that
        raise
    check_unchanged(stage, stage.sources(), sources, partial)
    if stage.digests() != digests:
        raise StageError("a stage before it changed meanwhile", stage.id.name, "run it again")
    return time.perf_counter() - started


def check_unchanged(
    stage: Stage, now: Mapping[Path, str], before: Mapping[Path, str], partial: Path | None = None
) -> None:
    """Raises StageError, and removes the partial work, where a file is not what it was before."""
    for path, digest in now.items():
        if before[path] != digest:
            if partial is not None:  # otherwise a rerun would resume it, should the old file return
                shutil.rmtree(partial, ignore_errors=True)
            what = f"{path.name} changed while the run was going on"
            raise StageError(what, stage.id.name, "run it again")


def recover(stage: Stage) -> None:
    """Bring the last good result back if a kill came while it was being replaced."""
    old = _old(stage)
    if stage.folder.exists():
        shutil.rmtree(old, ignore_errors=True)
    elif old.exists():
        old.rename(stage.folder)
    if not (partial := stage.partial()).exists():
        for ready in partial.parent.glob(f"{partial.name.replace(PARTIAL, READY)}-*"):
            with suppress(OSError):  # it is in its place by now
                ready.rename(partial)


def _sealed(stage: Stage, partial: Path) -> bool:
    """Whether the work was whole when its process ended, and still is; else it is begun again."""
    record = stage.record(partial)
    if record is None:
        return False
    for name, made in record["outputs"].items():
        path = partial / name
        if not path.is_file() or digest_file(path) != made["digest"]:
            shutil.rmtree(partial)
            partial.mkdir()
            return False
    return True


def _seal(stage: Stage, folder: Path, *, key: str, digests: dict[str, str], seconds: float) -> None:
    """Flush every output to the disk, then write the record."""
    shutil.rmtree(folder / CHECKSUMS, ignore_errors=True)
    outputs = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.name != RECORD):
        sync_file(path)
        name = path.relative_to(folder).as_posix()
        outputs[name] = {"bytes": path.stat().st_size, "digest": digest_file(path)}
    record = {
        "stage": stage.kind,
        "version": stage.version,
        "key": key,
        "parameters": dict(stage.parameters),
        "inputs": digests,
        "outputs": outputs,
        "versions": stage.versions(),
        "seconds": round(seconds, 2),
    }
    atomic_write_json(folder / RECORD, record)


def _swap(stage: Stage, partial: Path) -> None:
    """Put finished work in its place.

    A process may sleep anywhere in here, and another finish the stage meanwhile. So the work
    becomes this one's own first: of two that want to move it one alone can. A result that cannot
    be replaced goes back to where it lay.

    Raises:
        StageError: another process has taken the work over.
    """
    old = _old(stage)
    ready = partial.with_name(f"{partial.name.replace(PARTIAL, READY)}-{uuid4().hex}")
    try:
        patiently(lambda: partial.rename(ready))
        shutil.rmtree(old, ignore_errors=True)
        if stage.folder.exists():
            patiently(lambda: stage.folder.rename(old))
        patiently(lambda: ready.rename(stage.folder))
    except OSError as error:
        if old.exists() and not stage.folder.exists():
            old.rename(stage.folder)
        if error.errno not in OVERTAKEN:
            raise system_error(error, stage.folder) from error
        shutil.rmtree(ready, ignore_errors=True)
        if stage.changes():
            raise StageError(TAKEN_OVER, str(stage.folder), "run it again") from error
    sync_file(stage.folder.parent)
    shutil.rmtree(old, ignore_errors=True)


def _old(stage: Stage) -> Path:
    return stage.folder.with_name(f"{stage.folder.name}.old")
