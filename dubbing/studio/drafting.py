"""The process that draws frames: it holds people and films in memory, and alone loads torch.

It answers jobs through a pipe, one after another. K frames.
"""

from __future__ import annotations

import json
import signal
from collections import OrderedDict
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dubbing.batch.closures import closures_of, sound_of, with_closures
from dubbing.batch.curves import listen_to
from dubbing.batch.jobs import build
from dubbing.engine.memory import SHORT
from dubbing.errors import ExplainedError
from dubbing.script.edit import Edit
from dubbing.stages.draft import Draft
from dubbing.studio.film import DRAFT, DUB, FILM, MEASURED, Film, as_jpeg, of_jpeg

if TYPE_CHECKING:
    from dubbing.manifest.manifest import Production

CLOSURES, WORDS = "closures", "words"  # that are looked for in a line
MOST_KEPT = 300 * 10**6  # bytes of drawn frames


@dataclass(frozen=True)
class Job:
    """Work for the process.

    Attributes:
        number: of the job; answers bear it.
        ask: a function of `Desk`.
        dub: its name.
        arguments: of the function.
    """

    number: int
    ask: str
    dub: str
    arguments: dict[str, Any] = field(default_factory=dict)

    @property
    def urgent(self) -> bool:
        """Whether others rest meanwhile."""
        return self.arguments.get("kind") not in (FILM, DUB, MEASURED)


@dataclass(frozen=True)
class Answer:
    """Something that a job gave: a value, its end, or what went wrong."""

    number: int
    value: Any = None
    ended: bool = False
    error: str = ""


def serve(pipe: Connection, manifest: str, device: str) -> None:
    """Answer jobs until the other end is closed; a number alone takes its job back.

    Of several jobs the most urgent goes on; the others rest for as long.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends this
    desk = Desk(Path(manifest), device)
    begun: dict[int, tuple[Job, Generator[Any]]] = {}

    def listen() -> None:
        while pipe.poll(0 if begun else None):
            message = pipe.recv()
            if isinstance(message, Job):
                values = getattr(desk, message.ask)(message.dub, **message.arguments)
                begun[message.number] = message, values
            elif message in begun:
                begun.pop(message)[1].close()

    while True:
        try:
            listen()
            number = max(begun, key=lambda one: (begun[one][0].urgent, one))
            try:
                pipe.send(Answer(number, next(begun[number][1])))
            except (StopIteration, ExplainedError, OSError, MemoryError, RuntimeError) as error:
                del begun[number]
                words = "" if isinstance(error, StopIteration) else str(error) or SHORT
                pipe.send(Answer(number, ended=True, error=words))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            return


class Desk:
    """Holds films and drawn frames in memory, and does the work of jobs.

    Args:
        device: auto, cpu or cuda.
    """

    def __init__(self, manifest: Path, device: str) -> None:
        self.manifest, self.device = manifest, device
        self.films: dict[tuple[str, str], Film] = {}
        self.drawn: OrderedDict[tuple[str, str, int, str], bytes] = OrderedDict()

    @cached_property
    def production(self) -> Production:
        from dubbing.manifest.manifest import load

        return load(self.manifest)

    def film(self, name: str, heard: str) -> Film:
        """The film of a dub; another one than last time takes its place.

        Args:
            heard: names the recordings of its lines; other ones are listened to where they are new.
        """
        if (name, heard) not in self.films:
            self.films.clear()
            vars(self).pop("production", None)
            built = build(self.production, only=(name,), device=self.device, draft=True)
            job = built.by_label[f"dub/{name}"]
            listen_to(job)
            self.films[name, heard] = Film(job.stage(Draft))
        return self.films[name, heard]

    def curves(
        self, dub: str, folder: str, edits: dict[str, Edit], heard: str
    ) -> Iterator[dict[str, Any]]:
        """The sound of a dub as a file in a folder, and what is heard of lips in each line."""
        from dubbing.studio.sound import write_sound

        film = self.film(dub, heard)
        file, peaks = write_sound(self.production.dubs[dub], Path(folder))
        yield {"file": file, "peaks": peaks, "lines": film.heard(edits)}

    def of_line(
        self, dub: str, what: str, cue: str, edit: Edit, heard: str
    ) -> Iterator[list[dict[str, Any]]]:
        """When the words of a line are spoken, or its keys with closures at their labials."""
        from dubbing.speech.labials import words_in

        half = self.film(dub, heard).half
        (own,) = (one for one in self.production.dubs[dub].cues if one.name == cue)
        if what == WORDS:
            yield [vars(word) for word in words_in(sound_of(own), own.words)]
        else:
            keys = with_closures(edit.keys, closures_of(own, half), edit.strength)
            yield [{"at": at, "strength": strength} for at, strength in keys]

    def frames(
        self, dub: str, kind: str, wanted: list[tuple[int, str]], edits: dict[str, Edit], heard: str
    ) -> Generator[tuple[int, str, bytes]]:
        """Frames as JPEG with their numbers and signatures, in the order asked for.

        What is measured in frames of the draft, as JSON.
        """
        if kind == MEASURED:
            film = self.film(dub, heard)
            for number, mark, data in self.frames(dub, DRAFT, wanted, edits, heard):
                yield number, mark, json.dumps(film.measured(number, of_jpeg(data))).encode()
            return
        missing = []
        for number, mark in wanted:
            if (key := (dub, kind, number, mark)) in self.drawn:
                self.drawn.move_to_end(key)
                yield number, mark, self.drawn[key]
            else:
                missing.append((number, mark))
        marks = dict(missing)
        video = self.production.output / self.production.dubs[dub].results()["video"]
        with closing(self.film(dub, heard).draw(kind, list(marks), edits, video)) as images:
            for number, image in images:
                key = (dub, kind, number, marks[number])
                self.drawn[key] = as_jpeg(image)
                yield number, marks[number], self.drawn[key]
        size = sum(map(len, self.drawn.values()))
        while size > MOST_KEPT:
            size -= len(self.drawn.popitem(last=False)[1])
