"""The process that draws: which job goes first, how jobs end, and what is kept of the film."""

from __future__ import annotations

import signal
from collections.abc import Generator
from multiprocessing import Pipe
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest

from dubbing.errors import RenderingError
from dubbing.preparation.halved import HalvedClip
from dubbing.studio import drafting, film, kept_film
from dubbing.studio.drafting import Answer, Job
from dubbing.studio.film import DRAFT, FILM, blocks
from dubbing.studio.kept_film import KeptFilm
from tests import clips, fakes


def test_short_blocks_come_first_and_gaps_part_them() -> None:
    assert list(blocks(list(range(20)))) == [(0, 2), (2, 6), (6, 14), (14, 20)]
    assert list(blocks([7, 8, 9, 3, 4, 20])) == [(7, 9), (9, 10), (3, 5), (20, 21)]
    assert max(stop - first for first, stop in blocks(list(range(500)))) == film.LONGEST_BLOCK
    assert list(blocks([])) == []


class Desk:
    """Counts, and waits for a sign before each number."""

    closed: list[str]

    def __init__(self, *_: object) -> None:
        Desk.closed = []

    def count(self, dub: str, kind: str) -> Generator[int]:
        try:
            yield from range(1000)
        finally:
            Desk.closed.append(dub)

    def fail(self, dub: str) -> Generator[int]:
        yield 1
        raise RenderingError("no head", dub, "make one")


@pytest.fixture
def pipe(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(drafting, "Desk", Desk)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    ours, theirs = Pipe()
    thread = Thread(target=drafting.serve, args=(theirs, "m.yaml", "cpu"), daemon=True)
    thread.start()
    yield ours
    ours.close()
    thread.join()


def test_a_draft_goes_before_the_film_which_goes_on_after_it(pipe: Any) -> None:
    pipe.send(Job(1, "count", "film", {"kind": FILM}))
    assert pipe.recv() == Answer(1, 0)
    pipe.send(Job(2, "count", "draft", {"kind": DRAFT}))
    answers: list[Answer] = []
    while not answers or not answers[-1].ended:
        answers.append(pipe.recv())
    first = next(k for k, answer in enumerate(answers) if answer.number == 2)
    assert [answer.number for answer in answers[first:]] == [2] * 1001
    later = pipe.recv()
    assert (later.number, later.value) == (1, first + 1)


def test_a_job_that_is_taken_back_ends(pipe: Any) -> None:
    pipe.send(Job(1, "count", "one", {"kind": DRAFT}))
    pipe.send(1)
    pipe.send(Job(2, "count", "two", {"kind": DRAFT}))
    while not (answer := pipe.recv()).ended:
        pass
    assert answer == Answer(2, ended=True)
    assert Desk.closed in (["one", "two"], ["two"])  # one had not begun


def test_what_goes_wrong_is_said_and_the_next_job_is_done(pipe: Any) -> None:
    pipe.send(Job(1, "fail", "it"))
    assert pipe.recv() == Answer(1, 1)
    answer = pipe.recv()
    assert (answer.ended, answer.error) == (True, "no head (it): make one")
    pipe.send(Job(2, "count", "two", {"kind": DRAFT}))
    assert pipe.recv() == Answer(2, 0)


def test_a_kept_film_is_the_halved_one_and_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clips.write_clip(tmp_path / "film.mp4", 30)
    clip = fakes.write_prepared(tmp_path / "film.mp4", tmp_path / "prepared")
    halved, kept = HalvedClip.of(clip), KeptFilm.of(clip)
    reads: list[tuple[int, int | None]] = []
    real = HalvedClip.film_frames

    def film_frames(self: HalvedClip, start: int = 0, count: int | None = None) -> Any:
        reads.append((start, count))
        return real(self, start, count)

    monkeypatch.setattr(HalvedClip, "film_frames", film_frames)
    for frame, other in zip(kept.film_frames(5, 10), real(halved, 5, 10), strict=True):
        np.testing.assert_array_equal(frame.whole, other.whole)
        np.testing.assert_array_equal(frame.background, other.background)
    again = list(kept.whole_frames(0, 30))
    assert reads == [(5, 10), (0, 5), (15, 15)]
    for image, other_image in zip(again, halved.whole_frames(), strict=True):
        np.testing.assert_array_equal(image, other_image)
    monkeypatch.setattr(kept_film, "MOST_KEPT", 3 * kept_film.size_of(frame))
    few = KeptFilm.of(clip)
    list(few.film_frames())
    assert sorted(few.kept) == [27, 28, 29]
