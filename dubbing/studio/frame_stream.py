"""Frames on their way to the page: which it asks for, and the stream that they come in."""

from __future__ import annotations

import json
from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import aclosing
from typing import Any, Literal

from pydantic import BaseModel, ValidationError
from starlette.exceptions import HTTPException

from dubbing.errors import ExplainedError

MOST_FRAMES = 3000  # of one request


class Wanted(BaseModel):
    """Frames first .. stop that a page asks for, from one on, but for those that it has.

    Attributes:
        have: signatures of frames.
    """

    kind: Literal["film", "dub", "draft", "measured"]
    first: int
    stop: int
    at: int
    have: dict[int, str] = {}

    @staticmethod
    def of(given: dict[str, Any], length: int) -> Wanted:
        """The frames that a request asks for, of a dub of so many.

        Raises:
            HTTPException: it is none.
        """
        try:
            wanted = Wanted.model_validate(given)
        except ValidationError as error:
            detail = error.errors()[0]
            raise HTTPException(400, f"{detail['loc'][0]}: {detail['msg']}") from None
        first, stop = wanted.first, wanted.stop
        if not 0 <= first < stop <= length or stop - first > MOST_FRAMES:
            raise HTTPException(400, f"first and stop are frames of 0 to {length}")
        return wanted

    def missing(self, marks: Sequence[str]) -> list[tuple[int, str]]:
        """Numbers and signatures of those that the page does not have, in the order to send.

        Args:
            marks: the signatures of first .. stop as they are now.
        """
        found = [(k, mark) for k, mark in enumerate(marks, self.first) if self.have.get(k) != mark]
        return sorted(found, key=lambda one: (one[0] < self.at, one[0]))


async def stream(frames: AsyncGenerator[tuple[int, str, bytes]]) -> AsyncIterator[bytes]:
    """Records of frames, numbers with signatures and bodies; the last one may be an error.

    A record is two lengths of 4 bytes, a head in JSON, and a body.
    """
    try:
        async with aclosing(frames) as found:
            async for number, mark, body in found:
                yield _packed({"frame": number, "mark": mark}, body)
    except ExplainedError as error:
        yield _packed({"error": str(error)}, b"")


def _packed(head: dict[str, Any], body: bytes) -> bytes:
    text = json.dumps(head).encode()
    return len(text).to_bytes(4, "big") + len(body).to_bytes(4, "big") + text + body
