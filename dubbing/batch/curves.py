"""The curves of the lips of dubs as tables beside their results."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dubbing.batch import jobs, results
from dubbing.engine.disk.files import atomic_write_text, digest_bytes
from dubbing.engine.graph.graph import Job
from dubbing.engine.graph.stage import Stage
from dubbing.engine.running.update import run_stage
from dubbing.errors import ExplainedError, RenderingError
from dubbing.face.mouth.lip_curves import text_of
from dubbing.pipeline import DUB
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.script.edit import Edit
from dubbing.stages.draft import Draft, HalfSize
from dubbing.stages.listen import Listen


def write_curves(production: Production, only: tuple[str, ...] = ()) -> Iterator[Path]:
    """Write NAME.curves.csv of dubs into the output folder; gives each as it is written.

    Raises:
        ExplainedError: a person is not learned, or the file may not be written.
    """
    for dub, half in opened(production, only):
        yield _put(production, dub, text_of(rows_of(dub, half)))


def opened(production: Production, only: tuple[str, ...]) -> Iterator[tuple[Dub, HalfSize]]:
    """Dubs with their films and people.

    Raises:
        ExplainedError: a person is not learned.
    """
    for name, job in jobs.build(production, only=only, draft=True).named(DUB).items():
        for draft in job.all_of(Draft):
            check_made(production, name, draft)
            listen_to(job)
            yield production.dubs[name], draft.opened()


def check_made(production: Production, name: str, draft: Draft) -> None:
    """Check that the people of a draft are learned.

    Raises:
        ExplainedError: somebody is not.
    """
    needed = [one for one in draft.inputs.values() if isinstance(one, Stage)]
    if not all(one.record() for one in needed if not isinstance(one, Listen)):
        what = "a person is not learned yet"
        raise ExplainedError(what, name, f"run first: dfrf dub {production.manifest}")


def listen_to(job: Job) -> None:
    """Listen to the recordings of a job that were not listened to."""
    for stage in job.all_of(Listen):
        if stage.record() is None:
            run_stage(stage, lambda *_: None)


def rows_of(dub: Dub, half: HalfSize) -> Iterator[tuple[int, int, float, np.ndarray]]:
    """Line, frame of the dub, seconds of the line's sound and curves of the lips of all lines."""
    for cue in dub.cues:
        values = half.curves(cue, Edit(curves=cue.edit.curves))
        if values is None:
            what = f"the model of {cue.identity} has no lip measures"
            raise RenderingError(what, dub.name, "take preset 'fast'")
        times = Edit().heard(len(values), dub.film.rate)
        for k, (time, one) in enumerate(zip(times, values, strict=True), cue.first):
            yield cue.number, k, float(time), one


def _put(production: Production, dub: Dub, text: str) -> Path:
    target = production.output / f"{dub.name}.curves.csv"
    if any(c.edit.curves and c.edit.curves[0].resolve() == target.resolve() for c in dub.cues):
        what = "an edit reads this file, so it is not written"
        remedy = "copy it to another name, and let the edit name that"
        raise ExplainedError(what, str(target), remedy)
    with results.held(production) as ledger:
        results.refuse_others(ledger, target.name)
        ledger.enter({target.name: digest_bytes(text.encode())})
        atomic_write_text(target, text)
    return target
