"""The server of the page: the page's own files, the dubs of a manifest, and their frames."""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from dubbing import design
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.kept_edits import StaleError
from dubbing.script.timeline import Edit
from dubbing.studio.drafter import Drafter
from dubbing.studio.film import DRAFT, DUB, MEASURED
from dubbing.studio.guard import Guard
from dubbing.studio.making import Making
from dubbing.studio.project import Project

PAGE = Path(__file__).with_name("page")
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


def app_of(project: Project, drafter: Drafter, making: Making, **guard: Any) -> Starlette:
    """The application.

    Args:
        making: of the finished dubs.
        guard: arguments of `Guard`.
    """
    folder = tempfile.TemporaryDirectory(prefix="dfrf-studio-")

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        try:
            yield
        finally:
            making.stop()
            drafter.close()
            folder.cleanup()

    dub = "/api/dubs/{name}"
    server = Server(project, drafter, making, Path(folder.name))
    routes = [
        Route("/", lambda _: FileResponse(PAGE / "index.html")),
        Route("/api/dubs", server.dubs),
        Route(dub, server.dub),
        Route(f"{dub}/lines/{{cue}}", server.save, methods=["PUT"]),
        Route(f"{dub}/lines/{{cue}}/closures", server.closures),
        Route(f"{dub}/curves", server.curves),
        Route(f"{dub}/sound", server.sound),
        Route(f"{dub}/frames", server.frames, methods=["POST"]),
        Route(f"{dub}/revision", server.revision),
        Route(f"{dub}/making", server.make, methods=["PUT"]),
        Mount("/page", StaticFiles(directory=PAGE)),
        Mount("/design", StaticFiles(directory=design.FOLDER)),
    ]
    errors = {ExplainedError: _explained, HTTPException: _plain}
    app = Starlette(
        routes=routes,
        middleware=[Middleware(Guard, **guard)],
        exception_handlers=errors,  # type: ignore[arg-type]
        lifespan=lifespan,
    )
    app.state.drafter = drafter
    return app


class Server:
    """Answers requests for the dubs of a project.

    Args:
        folder: for sounds.
    """

    def __init__(self, project: Project, drafter: Drafter, making: Making, folder: Path) -> None:
        self.project, self.drafter, self.making, self.folder = project, drafter, making, folder
        self.curves_of: dict[tuple[str, str], asyncio.Task[dict[str, Any]]] = {}

    async def dubs(self, _: Request) -> Response:
        """The names of all dubs, and why some cannot be drafted."""
        found = {"dubs": [*self.project.dubs], "lacking": self.project.lacking}
        return JSONResponse(found)

    async def dub(self, request: Request) -> Response:
        """A dub with its lines."""
        name = self._name(request)
        return JSONResponse(await run_in_threadpool(self.project.shown, name))

    async def save(self, request: Request) -> Response:
        """Put the edit of a line into the file of edits."""
        name = self._name(request)
        cues = {cue.name: cue for cue in self.project.dubs[name].cues}
        cue = cues.get(request.path_params["cue"])
        given = await _json(request)
        if cue is None:
            raise HTTPException(404, f"{name} has no line {request.path_params['cue']}")
        if not isinstance(given.get("revision"), str) or "edit" not in given:
            raise HTTPException(400, "give the revision that was edited, and the edit")
        await run_in_threadpool(self.project.save, name, cue, given["revision"], given["edit"])
        return JSONResponse(await run_in_threadpool(self.project.shown, name))

    async def closures(self, request: Request) -> Response:
        """The keys of a line with closures at the labials of its words."""
        name, cue = self._name(request), request.path_params["cue"]
        edits = await run_in_threadpool(self.project.edits, name)
        if cue not in edits:
            raise HTTPException(404, f"{name} has no line {cue}")
        heard = self.project.heard(name)
        asked = self.drafter.ask("closures", name, cue=cue, edit=edits[cue], heard=heard)
        async with aclosing(asked) as found:  # type: ignore[type-var]
            keys = [{"at": at, "strength": strength} async for one in found for at, strength in one]
        return JSONResponse({"keys": keys})

    async def curves(self, request: Request) -> Response:
        """Peaks of the sound, and by line what is heard of lips."""
        found = await self._curves(self._name(request))
        return JSONResponse({key: found[key] for key in ("peaks", "lines")})

    async def sound(self, request: Request) -> Response:
        """The sound of a dub."""
        found = await self._curves(self._name(request))
        return FileResponse(found["file"], media_type="audio/flac")

    async def frames(self, request: Request) -> Response:
        """Frames of a dub from one on, then those before it; see `_packed`.

        Those that the page has, with the signatures that they have now, are left out.
        """
        name, given = self._name(request), await _json(request)
        try:
            asked_for = Wanted.model_validate(given)
        except ValidationError as error:
            detail = error.errors()[0]
            raise HTTPException(400, f"{detail['loc'][0]}: {detail['msg']}") from None
        kind, first, stop, at = (asked_for.kind, asked_for.first, asked_for.stop, asked_for.at)
        length = self.project.dubs[name].length
        if not 0 <= first < stop <= length or stop - first > MOST_FRAMES:
            raise HTTPException(400, f"first and stop are frames of 0 to {length}")
        if kind == DUB and self.project.video(name) is None:
            raise HTTPException(404, f"{name} is not made yet: run dfrf dub")
        marks = await run_in_threadpool(self.project.signatures, name, kind, first, stop)
        edits = self.project.edits(name) if kind in (DRAFT, MEASURED) else {}
        wanted = [(k, m) for k, m in enumerate(marks, first) if asked_for.have.get(k) != m]
        wanted.sort(key=lambda one: (one[0] < at, one[0]))

        async def stream() -> AsyncIterator[bytes]:
            asked = self.drafter.ask(
                "frames",
                name,
                kind=kind,
                wanted=wanted,
                edits=edits,
                heard=self.project.heard(name),
            )
            try:
                async with aclosing(asked) as found:  # type: ignore[type-var]
                    async for number, mark, image in found:
                        yield _packed({"frame": number, "mark": mark}, image)
            except ExplainedError as error:
                yield _packed({"error": str(error)}, b"")

        return StreamingResponse(
            stream(), headers={"x-frames": str(len(wanted))}, media_type="application/octet-stream"
        )

    async def revision(self, request: Request) -> Response:
        """The revision of a dub's edits, and how far a run is; pages ask again and again."""
        found = await run_in_threadpool(self.project.revision, self._name(request))
        return JSONResponse({"revision": found, "making": self.making.state()})

    async def make(self, request: Request) -> Response:
        """Make the finished dub with the edits as they are, or stop that."""
        name, given = self._name(request), await _json(request)
        if given.get("run") is True:
            self.making.start(name)
        elif given.get("run") is False:
            self.making.stop()
        else:
            raise HTTPException(400, "say whether to run: true or false")
        return JSONResponse(self.making.state())

    def _name(self, request: Request) -> str:
        name = str(request.path_params["name"])
        if name not in self.project.dubs:
            why = self.project.lacking.get(name, f"the manifest has no dub {name!r:.100}")
            raise HTTPException(404, why)
        return name

    async def _curves(self, name: str) -> dict[str, Any]:
        """Made once; made again where that failed."""
        edits = await run_in_threadpool(self.project.edits, name)
        key = name, self.project.heard(name)
        task = self.curves_of.get(key)
        if task is None or (task.done() and task.exception()):
            task = self.curves_of[key] = asyncio.create_task(self._ask_curves(*key, edits))
            # Whoever asked may have left the page: then nobody else takes the error.
            task.add_done_callback(lambda done: done.cancelled() or done.exception())
        return await asyncio.shield(task)

    async def _ask_curves(self, name: str, heard: str, edits: dict[str, Edit]) -> dict[str, Any]:
        folder = str(self.folder / heard)
        asked = self.drafter.ask("curves", name, folder=folder, edits=edits, heard=heard)
        async with aclosing(asked) as found:  # type: ignore[type-var]
            async for curves in found:
                return dict(curves)
        raise ExplainedError("no curves came")


def _packed(head: dict[str, Any], body: bytes) -> bytes:
    """A record of a stream: two lengths of 4 bytes, a head in JSON, a body."""
    text = json.dumps(head).encode()
    return len(text).to_bytes(4, "big") + len(body).to_bytes(4, "big") + text + body


async def _json(request: Request) -> dict[str, Any]:
    try:
        given = json.loads(await request.body())
    except ValueError:
        given = None
    if not isinstance(given, dict):
        raise HTTPException(400, "the request is no JSON object")
    return given


async def _explained(_: Request, error: Exception) -> Response:
    code = 409 if isinstance(error, StaleError) else 422
    return JSONResponse({"error": str(error)}, code)


async def _plain(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return JSONResponse({"error": error.detail}, error.status_code)
