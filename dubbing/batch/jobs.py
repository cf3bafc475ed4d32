"""The jobs of a manifest: which people and dubs are made, and where their stages lie."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from dubbing.engine.graph import Job, Jobs
from dubbing.errors import DubbingError
from dubbing.manifest.entries import Dub
from dubbing.manifest.manifest import Manifest, load
from dubbing.pipeline import dub_folder, dub_job, identity_job

MOST_NAMED = 20  # in a message


def build(manifest: Manifest, *, only: tuple[str, ...] = (), device: str = "auto") -> Jobs:
    """The jobs of a manifest, or of those identities and dubs that ``only`` names.

    Args:
        only: names, or patterns of names as a shell's: ``shot1_*``.

    Raises:
        DubbingError: ``only`` names something the manifest does not have.
    """
    named = chosen_names(only, [*manifest.identities, *(dub.name for dub in manifest.dubs)])
    dubs = [d for d in manifest.dubs if {d.name, *d.people} & named]
    needed = {name for dub in dubs for name in dub.people}
    films: dict[str, list[Path]] = {}
    for dub in dubs:
        if dub.name in manifest.scenes:
            for name in dub.people:
                films.setdefault(name, []).append(manifest.scenes[dub.name].clip)
    identities = {
        name: identity_job(manifest, name, identity, device, films.get(name, ()))
        for name, identity in manifest.identities.items()
        if name in named or name in needed
    }
    return Jobs(identities, {dub.name: _found(manifest, dub, identities, device) for dub in dubs})


def job_of(path: Path, label: str, device: str) -> Job:
    """One job of a manifest again, in a process that knows its label alone; see `Job.label`.

    Raises:
        DubbingError: the manifest is wrong, or has no such job.
    """
    kind, _, name = label.partition("/")
    manifest = load(path, only=(name,))
    named = {dub.name: dub for dub in manifest.dubs} if kind == "dub" else manifest.identities
    if name not in named:
        raise DubbingError(f"the manifest has no {kind} {name}", str(path), "run it again")
    wanted = named[name]
    people = {
        whose: identity_job(manifest, whose, identity, device, identity.films)
        for whose in (wanted.people if isinstance(wanted, Dub) else (name,))
        if (identity := manifest.identities[whose])
    }
    return _found(manifest, wanted, people, device) if isinstance(wanted, Dub) else people[name]


def _found(manifest: Manifest, dub: Dub, people: Mapping[str, Job], device: str) -> Job:
    """The job of a dub: where it lies under the name it had before, in the folder of that name."""
    job = dub_job(manifest, dub, people, device)
    folders = dub_folder(manifest, dub.name).parent
    if not job.stages or not folders.is_dir() or dub_folder(manifest, dub.name).exists():
        return job
    named = {other.name for other in manifest.dubs}
    for folder in sorted(p for p in folders.iterdir() if p.is_dir() and p.name not in named):
        renamed = dub_job(manifest, dub, people, device, folder)
        if not any(stage.changes() for stage in renamed.stages.values()):
            return renamed
    return job


def chosen_names(only: Sequence[str], names: Sequence[str]) -> set[str]:
    """The names that ``--only`` selects; all of them where ``only`` is empty.

    Args:
        only: names, or patterns of names as a shell's: ``shot1_*``. A name goes before a pattern.

    Raises:
        DubbingError: one of ``only`` selects nothing.
    """
    chosen: set[str] = set() if only else {*names}
    for pattern in only:
        found = {pattern} & {*names} or {name for name in names if fnmatchcase(name, pattern)}
        if not found:
            there = ", ".join(names[:MOST_NAMED]) + (", ..." if len(names) > MOST_NAMED else "")
            raise DubbingError(f"nothing is called {pattern}", "--only", f"there is {there}")
        chosen |= found
    return chosen
