"""The process that draws frames: it holds people and films in memory, and alone loads torch.

It answers jobs through a pipe, one after another. K frames.
"""

from __future__ import annotations

import signal
from collections import OrderedDict
from collections.abc import Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dubbing.batch.jobs import build
from dubbing.engine.memory import SHORT
from dubbing.errors import ExplainedError
from dubbing.face.lip_curves import LENGTHS
from dubbing.script.timeline import Cue, Edit
from dubbing.stages.draft import Draft

if TYPE_CHECKING:
    import numpy as np

    from dubbing.manifest.manifest import Production
    from dubbing.stages.draft import HalfSize

QUALITY = 88  # of JPEG
MOST_KEPT = 300 * 10**6  # bytes of drawn frames
FIRST_BLOCK, LONGEST_BLOCK = 2, 24  # frames that are rendered at once: the first comes soon
DRAWN = ("opening", "width")
SOURCE, DUB, DRAFT = "source", "dub", "draft"


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
        return self.arguments.get("kind") not in (SOURCE, DUB)


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
            except (StopIteration, ExplainedError, MemoryError, RuntimeError) as error:
                del begun[number]
                words = "" if isinstance(error, StopIteration) else str(error) or SHORT
                pipe.send(Answer(number, ended=True, error=words))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            return


class Desk:
    """What is held in memory, and the work that is done with it.

    Args:
        device: auto, cpu or cuda.
    """

    def __init__(self, manifest: Path, device: str) -> None:
        self.manifest, self.device = manifest, device
        self.films: OrderedDict[str, Film] = OrderedDict()
        self.drawn: OrderedDict[tuple[str, str, int, str], bytes] = OrderedDict()

    @cached_property
    def production(self) -> Production:
        from dubbing.manifest.manifest import load

        return load(self.manifest)

    def film(self, name: str) -> Film:
        """The film of a dub; another one than last time takes its place."""
        if name not in self.films:
            self.films.clear()
            job = build(self.production, only=(name,), device=self.device, draft=True)
            self.films[name] = Film(job.by_label[f"dub/{name}"].stage(Draft))
        return self.films[name]

    def curves(self, dub: str, folder: str, edits: dict[str, Edit]) -> Iterator[dict[str, Any]]:
        """The sound of a dub as a file in a folder, and what is heard of lips in each line."""
        from dubbing.studio.sound import write_sound

        film = self.film(dub)
        file, peaks = write_sound(self.production.dubs[dub], Path(folder))
        yield {"file": file, "peaks": peaks, "lines": film.heard(edits)}

    def frames(
        self, dub: str, kind: str, wanted: list[tuple[int, str]], edits: dict[str, Edit]
    ) -> Generator[tuple[int, str, bytes]]:
        """Frames as JPEG with their numbers and signatures, in the order asked for."""
        missing = []
        for number, mark in wanted:
            if (key := (dub, kind, number, mark)) in self.drawn:
                self.drawn.move_to_end(key)
                yield number, mark, self.drawn[key]
            else:
                missing.append((number, mark))
        marks = dict(missing)
        video = self.production.output / self.production.dubs[dub].results()["video"]
        with closing(self.film(dub).draw(kind, list(marks), edits, video)) as images:
            for number, image in images:
                key = (dub, kind, number, marks[number])
                self.drawn[key] = as_jpeg(image)
                yield number, marks[number], self.drawn[key]
        size = sum(map(len, self.drawn.values()))
        while size > MOST_KEPT:
            size -= len(self.drawn.popitem(last=False)[1])


class Film:
    """The film of one dub with its people, at half size."""

    def __init__(self, stage: Draft) -> None:
        from dubbing.studio.kept_film import KeptFilm

        self.stage = stage
        opened = stage.opened()
        clips = {name: KeptFilm.of(clip.full) for name, clip in opened.clips.items()}  # type: ignore[attr-defined]
        self.half: HalfSize = replace(opened, clips=clips)
        self.length = len(self.half.poses)

    @property
    def cues(self) -> tuple[Cue, ...]:
        return self.stage.sound.cues

    def draw(
        self, kind: str, numbers: list[int], edits: dict[str, Edit], video: Path
    ) -> Generator[tuple[int, np.ndarray]]:
        """Images (H, W, 3) uint8 of frames of the dub, with their numbers."""
        import numpy as np

        from dubbing.media.overlap import ahead
        from dubbing.video.composer import Composer, read_film

        heads = [self.half.heads(cue, edits.get(cue.name, Edit())) for cue in self.cues]
        composer = Composer(heads, self.half.poses, self.stage.settings)

        def read(first: int, stop: int) -> Iterator[Any]:
            if kind == DUB:
                return of_video(video, first, stop, composer.size)
            if kind == SOURCE:
                return read_film(composer.film, self.half.poses[first:stop])
            return composer.read(first, stop)

        def every() -> Iterator[Any]:
            for first, stop in blocks(numbers):
                yield from zip(range(first, stop), read(first, stop), strict=False)

        with closing(ahead(every())) as found:
            for number, one in found:
                if kind == DRAFT:
                    image, faces = one
                    pose = int(self.half.poses[number])
                    drawn = composer.frame(None, image, faces, pose, number)
                    yield number, np.asarray(drawn)  # a draft has no planes
                else:
                    yield number, one

    def heard(self, edits: Mapping[str, Edit]) -> dict[str, dict[str, Any]]:
        """By cue: opening and width of the lips in its frames, heard and of a closed mouth.

        In eye distances; nothing of models without lip measures.
        """
        return {cue.name: self._heard(cue, edits.get(cue.name, Edit())) for cue in self.cues}

    def _heard(self, cue: Cue, edit: Edit) -> dict[str, Any]:
        import numpy as np

        heard = self.half.lips(cue, edit)
        if heard is None:
            return {}
        closed = self.half.lips(cue, Edit(), np.zeros(len(heard), np.float32))
        assert closed is not None
        return {
            name: {"heard": heard[:, k].round(4).tolist(), "closed": round(float(closed[0, k]), 4)}
            for k, name in enumerate(LENGTHS)
            if name in DRAWN
        }


def blocks(numbers: list[int]) -> Iterator[tuple[int, int]]:
    """Runs first .. stop of numbers, short ones first: what is rendered at once comes at once."""
    size, place = FIRST_BLOCK, 0
    while place < len(numbers):
        stop = place + 1
        while (
            stop - place < size and stop < len(numbers) and numbers[stop] == numbers[stop - 1] + 1
        ):
            stop += 1
        yield numbers[place], numbers[stop - 1] + 1
        place, size = stop, min(2 * size, LONGEST_BLOCK)


def of_video(video: Path, first: int, stop: int, size: tuple[int, int]) -> Iterator[np.ndarray]:
    """Frames of the finished video, as large as those of the draft."""
    import cv2

    from dubbing.media import read_frames

    for image in read_frames(video, start=first, count=stop - first):
        yield cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def as_jpeg(image: np.ndarray) -> bytes:
    """An image (H, W, 3) uint8 RGB as a file."""
    import cv2

    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return data.tobytes()
