"""JSON that this tool has kept: read back only if it has the shape it was written in."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from ..errors import ExplainedError
from .files import read_bounded

MOST_BYTES = 100 * 10**6  # the record of a day of rendered heads is a tenth of it

Shape = TypeVar("Shape")
Default = TypeVar("Default")


def read(
    path: Path, shape: Callable[..., Shape], whose: str, remedy: str = "run it again"
) -> Shape:
    """Content of a JSON file that this program wrote, as ``shape``: a type that pydantic checks.

    Args:
        whose: what the file is, for the message.
        remedy: what to do where it is something else.

    Raises:
        ExplainedError: missing, unreadable, no JSON, or JSON of another shape.
    """
    try:
        content = read_bounded(path, MOST_BYTES)
    except OSError as error:
        what = f"{whose} cannot be read: {error.strerror}"
        raise ExplainedError(what, str(path), remedy) from error
    return parse(content, shape, whose, str(path), remedy)


def read_or(default: Default, path: Path, shape: Callable[..., Shape]) -> Shape | Default:
    """The same, and ``default`` where `read` raises."""
    try:
        return read(path, shape, "")
    except ExplainedError:
        return default


def parse(
    content: bytes | str, shape: Callable[..., Shape], whose: str, where: str, remedy: str
) -> Shape:
    """JSON text as ``shape``; see `read`."""
    try:
        found: Shape = adapter(shape).validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        what = f"{whose} holds something else: {f'{place}: ' if place else ''}{first['msg']}"
        raise ExplainedError(what, where, remedy) from error
    return found


@lru_cache
def adapter(shape: Any) -> TypeAdapter[Any]:
    """Reads and writes data of a shape, as pydantic checks it."""
    return TypeAdapter(shape)
