"""The server of the page: the page's own files, the dubs of a manifest, and their frames."""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path
from typing import Any

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
from dubbing.script.edit import Edit
from dubbing.studio.drafter import Drafter
from dubbing.studio.drafting import CLOSURES, WORDS
from dubbing.studio.film import DRAFT, DUB, MEASURED
from dubbing.studio.frame_stream import Wanted, stream
from dubbing.studio.guard import Guard
from dubbing.studio.making import Making
from dubbing.studio.project import Project

PAGE = Path(__file__).with_name("page")


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
        Route(f"{dub}/lines/{{cue}}/{{what}}", server.of_line),
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

    async def of_line(self, request: Request) -> Response:
        """When the words of a line are spoken, or its keys with closures at their labials."""
        name, cue, what = self._name(request), *map(request.path_params.get, ("cue", "what"))
        edits = await run_in_threadpool(self.project.edits, name)
        if cue not in edits or what not in (CLOSURES, WORDS):
            raise HTTPException(404, f"{name} has no line {cue}, or a line no {what}")
        own = {"what": what, "cue": cue, "edit": edits[cue], "heard": self.project.heard(name)}
        async with aclosing(self.drafter.ask("of_line", name, **own)) as found:
            return JSONResponse([one async for some in found for one in some])

    async def curves(self, request: Request) -> Response:
        """Peaks of the sound, and by line what is heard of lips."""
        found = await self._curves(self._name(request))
        return JSONResponse({key: found[key] for key in ("peaks", "lines")})

    async def sound(self, request: Request) -> Response:
        """The sound of a dub."""
        found = await self._curves(self._name(request))
        return FileResponse(found["file"], media_type="audio/flac")

    async def frames(self, request: Request) -> Response:
        """Frames of a dub from one on, then those before it; see `frame_stream`.

        Those that the page has, with the signatures that they have now, are left out.
        """
        name = self._name(request)
        wanted = Wanted.of(await _json(request), self.project.dubs[name].length)
        kind, first, stop = wanted.kind, wanted.first, wanted.stop
        if kind == DUB and self.project.video(name) is None:
            raise HTTPException(404, f"{name} is not made yet: run dfrf dub")
        marks = await run_in_threadpool(self.project.signatures, name, kind, first, stop)
        missing = wanted.missing(marks)
        of_lips = kind in (DRAFT, MEASURED)
        edits = await run_in_threadpool(self.project.edits, name) if of_lips else {}
        own = {"kind": kind, "wanted": missing, "edits": edits, "heard": self.project.heard(name)}
        frames = stream(self.drafter.ask("frames", name, **own))
        about = {"x-frames": str(len(missing))}
        return StreamingResponse(frames, headers=about, media_type="application/octet-stream")

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
        async with aclosing(asked) as found:
            async for curves in found:
                return dict(curves)
        raise ExplainedError("no curves came")


async def _json(request: Request) -> dict[str, Any]:
    try:
        given = json.loads(await request.body())
    except (ValueError, RecursionError):  # of thousands of brackets
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
