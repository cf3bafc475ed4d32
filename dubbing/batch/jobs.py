"""The jobs of a production: all of them, those that a user names, and one of them again."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase

from dubbing.engine.disk import claims
from dubbing.engine.graph.graph import Job, Jobs
from dubbing.errors import ExplainedError
from dubbing.pipeline import draft_job, dub_job, people_jobs
from dubbing.production.dub import Dub
from dubbing.production.production import Production

MOST_NAMED = 20  # in a message


def build(
    production: Production,
    *,
    only: tuple[str, ...] = (),
    device: str = "auto",
    adopt: bool = False,
    draft: bool = False,
) -> Jobs:
    """The jobs of a production, or of those people and dubs that ``only`` names.

    Args:
        only: names, or patterns of names as a shell's: ``shot1_*``.
        adopt: whether the folder of a dub that was renamed gets its new name.
        draft: whether drafts are made in the place of dubs.

    Raises:
        ExplainedError: ``only`` names something that there is not.
    """
    named = chosen_names(only, [*production.people, *production.dubs])
    dubs = chosen_dubs(production, only)
    needed = {person.name for dub in dubs for person in dub.people}
    people = [p for p in production.people.values() if p.name in named or p.name in needed]
    made = people_jobs(people, dubs, production.work, device)
    if draft:
        of_dubs = [draft_job(dub, made, production.work, device) for dub in dubs]
    else:
        of_dubs = [_found(production, dub, made, device, adopt) for dub in dubs]
    return Jobs.of([*made.values(), *of_dubs])


def chosen_dubs(production: Production, only: tuple[str, ...]) -> list[Dub]:
    """The dubs that ``only`` names, or whose people it names.

    Raises:
        ExplainedError: ``only`` names something that there is not.
    """
    named = chosen_names(only, [*production.people, *production.dubs])
    return [
        dub
        for dub in production.dubs.values()
        if {dub.name, *(person.name for person in dub.people)} & named
    ]


def with_others(production: Production, planned: Jobs) -> Jobs:
    """The planned jobs, and all others of their production."""
    if len(planned.by_label) == len(production.people) + len(production.dubs):
        return planned
    return build(production)


def _found(
    production: Production, dub: Dub, people: Mapping[str, Job], device: str, adopt: bool
) -> Job:
    """The job of a dub, in the folder of the name that it had before, if it was renamed."""
    job = dub_job(dub, people, production.work, device)
    folders = job.folder.parent
    if not job.stages or not folders.is_dir() or job.folder.exists():
        return job
    for folder in sorted(p for p in folders.iterdir() if p.is_dir()):
        if folder.name in production.dub_names:
            continue
        renamed = dub_job(dub, people, production.work, device, folder.name)
        if not any(stage.changes() for stage in renamed.stages.values()):
            at_work = any(folder.rglob(f"*{claims.SUFFIX}"))  # another run, which needs its name
            if not adopt or at_work:
                return renamed
            with suppress(FileNotFoundError):  # another run was quicker
                folder.rename(job.folder)
            return job
    return job


def chosen_names(only: Sequence[str], names: Sequence[str]) -> set[str]:
    """The names that ``--only`` selects; all of them where ``only`` is empty.

    Args:
        only: names, or patterns of names as a shell's: ``shot1_*``. A name goes before a pattern.

    Raises:
        ExplainedError: one of ``only`` selects nothing.
    """
    chosen: set[str] = set() if only else {*names}
    for pattern in only:
        found = {pattern} & {*names} or {name for name in names if fnmatchcase(name, pattern)}
        if not found:
            there = ", ".join(names[:MOST_NAMED]) + (", ..." if len(names) > MOST_NAMED else "")
            raise ExplainedError(f"nothing is called {pattern}", "--only", f"there is {there}")
        chosen |= found
    return chosen
