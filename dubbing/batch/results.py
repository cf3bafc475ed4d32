"""Owners of the files in an output folder: a run replaces only results of its own manifest.

``work/results.json`` there names every result: the manifest that made it, and its digest. It is
written before a result is put in its place. So what it does not know is somebody else's file. The
last results of a dub's name are kept beside the present ones, as ``NAME.previous.mp4``.
"""

import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from dubbing.engine.disk import claims, json_records
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import (
    atomic_path,
    atomic_write_bytes,
    atomic_write_json,
    digest_bytes,
    digest_data,
    remove_torn,
    seen_from,
    writing,
)
from dubbing.errors import ExplainedError, ManifestError, Problem
from dubbing.media import SUFFIX
from dubbing.pipeline import dub_folder
from dubbing.production.dub import Dub
from dubbing.production.production import REPORTS, Production

LEDGER = "results.json"
RESULTS = "results"  # claimed while they are put into the output folder
VIDEO = "video"  # of the kinds of results: where it stays, the results of before are not kept


class Entry(TypedDict):
    """A result: the manifest that made it, seen from the output folder; and its digest."""

    manifest: str
    digest: str


class Report(TypedDict):
    """The part of a report that tells whose results are there."""

    manifest: str
    dubs: dict[str, Any]


@dataclass
class Ledger:
    """The results in the output folder of a production."""

    production: Production
    entries: dict[str, Entry]

    @property
    def own(self) -> str:
        """How it names the manifest."""
        return self.named(self.production.manifest)

    def named(self, manifest: Path) -> str:
        """A manifest as it is seen from the output folder: both may be moved together."""
        return seen_from(self.production.output, manifest)

    def others(self) -> list[str]:
        """The other manifests that results are of, which are still there."""
        named = dict.fromkeys(entry["manifest"] for entry in self.entries.values())
        return [other for other in named if self._other(other)]

    def problem(self, name: str) -> str:
        """Why a result must not be replaced; empty where it may be, or is not there."""
        target = self.production.output / name
        if not os.path.lexists(target) or target.is_dir():  # which cannot be replaced
            return ""
        entry = self.entries.get(name)
        if entry is None:
            return f"{target} was not made by this tool, and is not replaced: move it away"
        if self._other(entry["manifest"]):
            other = os.path.normpath(self.production.output / entry["manifest"])
            return f"{target} is a result of {other}: choose another name or output"
        exchanged = entry["digest"] not in ("", digest_of(target)) and not self._in_work(target)
        if exchanged and target.suffix in SUFFIX.values():
            return f"{target} is another file than was made, and is not replaced: move it away"
        return ""

    def enter(self, digests: Mapping[str, str]) -> None:
        """Name results as those of this manifest, before they are put in their places."""
        new = {name: Entry(manifest=self.own, digest=digests[name]) for name in digests}
        if any(self.entries.get(name) != entry for name, entry in new.items()):
            self.entries |= new
            self.keep()

    def keep(self) -> None:
        """Write it."""
        path = self.production.work / LEDGER
        remove_torn(path)
        atomic_write_json(path, dict(sorted(self.entries.items())))  # the same from every run

    def _in_work(self, target: Path) -> bool:
        """Whether it is a file of a stage, too: then that stage sees what became of it."""
        return any(target.samefile(p) for p in (self.production.work / "dubs").glob("*/*/*"))

    def _other(self, manifest: str) -> bool:
        return manifest != self.own and (self.production.output / manifest).is_file()


def ledger_of(production: Production) -> Ledger:
    """The ledger of the output folder of a manifest.

    Raises:
        ExplainedError: its ledger holds something else.
    """
    path = production.work / LEDGER
    if os.path.lexists(path):
        found = json_records.read(path, dict[str, Entry], "the list of results", "move it away")
        return Ledger(production, found)
    ledger = Ledger(production, {})
    # It was removed with `work`, or never kept by the version that made them.
    empty = Report(manifest="", dubs={})
    report = json_records.read_or(empty, production.output / REPORTS[-1], Report)
    made_by = Path(report["manifest"] or production.manifest)
    same = made_by.name == production.manifest.name  # all of it may have been moved or copied
    known = ledger.own if same else ledger.named(made_by)
    for dub in production.dubs.values():
        if dub.name in report["dubs"] or dub_folder(production.work, dub.name).is_dir():
            ledger.entries |= {name: Entry(manifest=known, digest="") for name in _names(dub)}
    if ledger.entries:
        ledger.entries |= {name: Entry(manifest=known, digest="") for name in REPORTS}
    return ledger


@contextmanager
def held(production: Production) -> Iterator[Ledger]:
    """The ledger, while no other run changes it or puts results there; see `ledger_of`."""
    with claims.hold(production.work / RESULTS, wait=True):
        yield ledger_of(production)


def check(production: Production, dubs: Iterable[Dub]) -> None:
    """Before a run: nothing that is not its own would be replaced.

    Raises:
        ManifestError: something would.
    """
    try:
        ledger = ledger_of(production)
    except ExplainedError as error:
        raise ManifestError(str(production.manifest), [Problem(0, "output", str(error))]) from error
    wanted = {dub.name for dub in dubs}
    problems = []
    for place, dub in enumerate(production.dubs.values()):
        for name in _names(dub) if dub.name in wanted else ():
            if problem := ledger.problem(name):
                problems.append(Problem(0, f"dubs[{place}]", problem))
    for name in REPORTS:
        if name not in ledger.entries and (problem := ledger.problem(name)):
            problems.append(Problem(0, "output", problem))
    if problems:
        raise ManifestError(str(production.manifest), problems)


def warnings(production: Production, made_again: Iterable[str]) -> Iterator[str]:
    """Warnings of earlier results that a run replaces.

    Args:
        made_again: dubs whose video will be made.
    """
    ledger = ledger_of(production)
    for other in ledger.others():
        yield (
            f"output: holds results of {os.path.normpath(production.output / other)}, too; people "
            "of one name take the place of one another there, and report.html is of the last run"
        )
    again = {*made_again}
    for dub in production.dubs.values():
        video = dub.results()[VIDEO]
        if dub.name in again and (production.output / video).exists():
            before = dub.previous(video)
            lost = ", in place of the one there" if (production.output / before).exists() else ""
            yield f"{dub.name}: {video} is made again; that of now is kept as {before}{lost}"


def put(ledger: Ledger, dub: Dub, files: Mapping[str, Path], texts: Mapping[str, str]) -> None:
    """Put a dub's results into the output folder; where its video is a new one, keep the last.

    Args:
        files, texts: by kind, as `results_of` names them.

    Raises:
        ExplainedError: one of them is not ours to replace, or nothing can be written.
    """
    output, names = ledger.production.output, dub.results()
    contents = {kind: text.encode(errors="backslashreplace") for kind, text in texts.items()}
    made = {
        names[kind]: digest_bytes(contents[kind]) if kind in contents else digest_of(files[kind])
        for kind in names
    }
    for name in _names(dub):
        refuse_others(ledger, name)
        remove_torn(output / name)
    there = {name: digest_of(output / name) for name in names.values()}
    if there[names[VIDEO]] not in ("", made[names[VIDEO]]):
        before = {name: dub.previous(name) for name, digest in there.items() if digest}
        ledger.enter({before[name]: there[name] for name in before})
        for name, last in before.items():
            _link(output / name, output / last)
    ledger.enter(made)
    for kind, name in names.items():
        if there[name] == made[name]:
            continue
        if kind in contents:
            atomic_write_bytes(output / name, contents[kind])
        else:
            _link(files[kind], output / name)


def put_frames(ledger: Ledger, dub: Dub, folder: Path) -> None:
    """Put the frames that are delivered with a dub into a folder of its name; keep the last ones.

    Raises:
        ExplainedError: a folder there is not ours to replace, or nothing can be written.
    """
    name = f"{dub.name}.{dub.settings.deliver}"
    target, before = (ledger.production.output / one for one in (name, dub.previous(name)))
    files = sorted(folder.iterdir())
    digest = digest_data({file.name: digest_of(file) for file in files})
    known = ledger.entries.get(name)
    if target.exists() and known is None:
        raise ExplainedError("was not made by this tool", str(target), "move it away")
    if target.exists() and known and known["digest"] == digest:
        return
    ledger.enter({name: digest} | ({before.name: known["digest"]} if known else {}))
    new = target.with_name(f".{name}.new")
    shutil.rmtree(new, ignore_errors=True)
    for file in files:
        _link(file, new / file.name)
    with writing(target):
        if target.exists():
            shutil.rmtree(before, ignore_errors=True)
            target.rename(before)
        new.rename(target)


def put_draft(ledger: Ledger, dub: Dub, video: Path) -> Path:
    """Put the draft of a dub into the output folder, in place of the one there.

    Raises:
        ExplainedError: a file there is not ours to replace, or nothing can be written.
    """
    refuse_others(ledger, dub.draft)
    target = ledger.production.output / dub.draft
    ledger.enter({dub.draft: digest_of(video)})
    _link(video, target)
    return target


def refuse_others(ledger: Ledger, name: str) -> None:
    """Refuse to replace a result that is not of this manifest.

    Raises:
        ExplainedError: it is not.
    """
    if problem := ledger.problem(name):
        what, _, remedy = problem.rpartition(": ")
        raise ExplainedError(what, remedy=remedy)


def _names(dub: Dub) -> Iterator[str]:
    """Its results, and those of before."""
    for name in dub.results().values():
        yield from (name, dub.previous(name))


def _link(source: Path, target: Path) -> None:
    with atomic_path(target) as temporary, writing(target):
        try:
            os.link(source, temporary)  # the same bytes once on the disk
        except OSError:  # a file system without hard links
            shutil.copyfile(source, temporary)
