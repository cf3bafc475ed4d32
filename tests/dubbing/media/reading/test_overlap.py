import threading
from collections.abc import Iterator

import pytest

from dubbing.media.reading.overlap import ahead, behind


def test_ahead_gives_all_items_in_order() -> None:
    assert list(ahead(range(100))) == list(range(100))
    assert list(ahead([])) == []


def test_ahead_stays_only_so_far_ahead() -> None:
    taken: list[int] = []

    def source() -> Iterator[int]:
        for k in range(100):
            taken.append(k)
            yield k

    items = ahead(source(), depth=3)
    next(items)
    assert len(taken) <= 5
    items.close()
    assert len(taken) <= 6


def test_ahead_closes_its_source() -> None:
    closed = threading.Event()

    def source() -> Iterator[int]:
        try:
            while True:
                yield 1
        finally:
            closed.set()

    items = ahead(source())
    next(items)
    items.close()
    assert closed.is_set()


def test_ahead_raises_where_the_item_would_be() -> None:
    def source() -> Iterator[int]:
        yield 1
        raise KeyError("second")

    items = ahead(source())
    assert next(items) == 1
    with pytest.raises(KeyError, match="second"):
        next(items)


def test_behind_writes_all_in_order() -> None:
    written: list[int] = []
    with behind(written.append) as write:
        for k in range(50):
            write(k)
    assert written == list(range(50))


def _refuse(_item: int) -> None:
    raise OSError("disk full")


def _write_twice() -> None:
    with behind(_refuse) as write:
        write(1)
        write(2)


def test_behind_raises_what_the_writer_raised() -> None:
    with pytest.raises(OSError, match="disk full"):
        _write_twice()
