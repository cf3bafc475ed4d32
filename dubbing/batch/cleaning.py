"""Finds and removes files of an output folder that its manifest no longer asks for."""

import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dubbing.batch import jobs, results
from dubbing.batch.results import LEDGER, RESULTS, Ledger
from dubbing.engine.disk import claims
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import PARTIAL, digest_data, writing
from dubbing.engine.graph.graph import Job
from dubbing.errors import CallError
from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.keys import yaml_lines
from dubbing.pipeline import DUB
from dubbing.production.dub import Dub
from dubbing.production.production import REPORTS, Production
from dubbing.report.sources import PROXIES
from dubbing.report.takes import FIGURES
from dubbing.report.thumbnails import THUMBNAILS
from dubbing.stages.listen import Listen
from dubbing.stages.render import Render

EVALUATION = "evaluation"  # folder of `dfrf evaluate`, whose work this is not


@dataclass(frozen=True)
class Surplus:
    """A file or folder to remove, and its bytes; those of a file with two names count once."""

    path: Path
    size: int


def surplus(production: Production, *, takes: bool = False) -> list[Surplus]:
    """Files and folders of the output folder that are neither asked for nor read.

    Links, and files that were not made by this manifest or are not as it made them, are left alone;
    so is what another run is at work on.

    Args:
        takes: whether that of takes that are not chosen is to go, too.

    Raises:
        CallError: another manifest has results there.
        ExplainedError: the list of results cannot be read.
    """
    ledger = results.ledger_of(production)
    if others := ledger.others():
        what = f"the output folder is that of {others[0]}, too"
        raise CallError(what, str(production.output), "give each manifest an output of its own")
    wanted = {*REPORTS, *(name for dub in production.dubs.values() for name in _names(dub))}
    kept = _kept(production, wanted, takes=takes)
    around = {folder for path in kept for folder in path.parents}
    found = [*_results(ledger, wanted)]
    if production.work.is_dir() and not production.work.is_symlink():
        found += _below(production.work, kept, around)
    read = _read(production)
    free = (path for path in found if not _in_use(path) and not _holds(path, read))
    seen: set[tuple[int, int]] = set()
    return [Surplus(path, _size(path, seen)) for path in free]


def remove(production: Production, found: Iterable[Surplus]) -> None:
    """Remove them, and folders that are empty then.

    Raises:
        ExplainedError: something cannot be removed.
    """
    with results.held(production) as ledger:
        for one in found:
            with writing(one.path):
                if one.path.is_dir():
                    shutil.rmtree(one.path)
                else:
                    one.path.unlink(missing_ok=True)
            ledger.entries.pop(str(one.path.relative_to(production.output)), None)
            for folder in one.path.parents:
                if production.work in folder.parents and not any(folder.iterdir()):
                    folder.rmdir()
        ledger.keep()


def _names(dub: Dub) -> Iterator[str]:
    """Names of all results that a dub can have, and of the last ones."""
    folder = f"{dub.name}.{dub.settings.deliver}"
    for name in (*dub.results().values(), folder):
        yield from (name, dub.previous(name))
    yield from (dub.draft, f"{dub.name}.curves.csv")


def _kept(production: Production, wanted: set[str], *, takes: bool) -> set[Path]:
    """Files and folders among the stages that are asked for."""
    work = production.work
    kept = {work / LEDGER, work / EVALUATION}
    kept |= {work / THUMBNAILS / f"{Path(name).stem}.jpg" for name in wanted}
    films = (dub.film.path for dub in production.dubs.values())
    kept |= {work / PROXIES / f"{digest_of(film)[:16]}.mp4" for film in films}
    for draft in (False, True):
        for job in jobs.build(production, draft=draft).all():
            kept |= _of_job(job)
            if job.kind == DUB and not takes:
                kept |= _of_takes(production.dubs[job.name], job)
    for person in production.people.values():
        if any(clip.damaged for clip in (*person.clips, *person.learned)):
            kept.add(work / "identities" / person.name)  # some of its stages are not known now
    return kept


def _of_job(job: Job) -> set[Path]:
    """The folders of a job's stages, and of the present work on them."""
    if job.blocked or not job.stages:
        return {job.folder}
    kept = set()
    for stage in job.stages.values():
        beside = stage.folder.parent.glob(f"{stage.folder.name}.*")
        mine = {path for path in beside if PARTIAL not in path.name}
        figures = [stage.folder.parent / FIGURES] * isinstance(stage, Render)
        kept |= {stage.folder, stage.partial(), *figures, *mine}
    return kept


def _of_takes(dub: Dub, job: Job) -> set[Path]:
    """Folders of all takes of the lines of a dub."""
    cues = job.folder / job.parts
    kept = {cues} if dub.length_of_take else set()
    for cue in dub.cues:
        for name, _ in cue.edit.takes:
            folder = cues / cue.folder_of(name)
            kept |= {folder / part for part in (Listen.kind, Render.kind, FIGURES)}
    return kept


def _results(ledger: Ledger, wanted: set[str]) -> Iterator[Path]:
    """Results of this manifest that are as it made them, and of no dub any more."""
    for name, entry in sorted(ledger.entries.items()):
        target = ledger.production.output / name
        own = (
            Path(name).name == name and not target.is_symlink() and entry["manifest"] == ledger.own
        )
        if name in wanted or not own or not target.exists():
            continue
        digest = digest_of(target)
        if target.is_dir():
            digest = digest_data({one.name: digest_of(one) for one in sorted(target.iterdir())})
        if digest == entry["digest"]:
            yield target


def _below(folder: Path, kept: set[Path], around: set[Path]) -> Iterator[Path]:
    """Files and folders below a folder that are not kept."""
    for path in sorted(folder.iterdir()):
        if path in kept or path.is_symlink() or path.suffix == claims.SUFFIX or path.name[0] == ".":
            continue
        if path in around:
            yield from _below(path, kept, around)
        else:
            yield path


def _in_use(path: Path) -> bool:
    """Whether a run is at work on it, or beside it."""
    for place in (path.parent, *(one for one in path.rglob("*") if one.is_dir())):
        claims.sweep(place)
    beside = (one for one in path.parent.glob(f"*{claims.SUFFIX}") if one.stem != RESULTS)
    return any(beside) or any(path.rglob(f"*{claims.SUFFIX}"))


def _read(production: Production) -> set[Path]:
    """Everything that a manifest and its files of edits name, as if it were a file, and sounds."""
    texts = [production.manifest, *(edits_file(production.manifest, n) for n in production.dubs)]
    named: set[Path] = {cue.audio for dub in production.dubs.values() for cue in dub.cues}
    for text in filter(Path.is_file, texts):
        strings = _strings(yaml_lines.read(text.read_text(encoding="utf-8")).data)
        named |= {production.manifest.parent / one for one in strings if "\0" not in one}
    return {path.resolve() for path in (*texts, *named)}


def _strings(data: Any) -> Iterator[str]:
    if isinstance(data, str):
        yield data
    for one in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from _strings(one)


def _holds(path: Path, read: set[Path]) -> bool:
    """Whether something that is read is this file, or lies in this folder."""
    own = path.resolve()
    return any(own == one or own in one.parents for one in read)


def _size(path: Path, seen: set[tuple[int, int]]) -> int:
    """Bytes of files that were not seen before."""
    size = 0
    for file in (path, *path.rglob("*")):
        status = file.lstat()
        if not file.is_dir() and (key := (status.st_dev, status.st_ino)) not in seen:
            seen.add(key)
            size += status.st_size
    return size
