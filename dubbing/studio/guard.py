"""Who may use the page: whoever has the secret, from this page alone."""

import asyncio
import hmac
import ipaddress
import secrets
import socket
from urllib.parse import parse_qs, urlsplit

from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

LOCAL = ("127.0.0.1", "localhost", "::1")
WRONG_S = 0.5  # that the answer to a wrong password takes
MOST_BODY = 100_000  # bytes of a request
SAFE = ("GET", "HEAD")
HEADERS = {
    "content-security-policy": (
        "default-src 'self'; img-src 'self' blob: data:; media-src 'self' blob:; object-src 'none';"
        " style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'"
    ),
    "cache-control": "no-store",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}
PASSWORD_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>dfrf studio</title>
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<body style="font: 16px system-ui; max-width: 24em; margin: 4em auto; padding: 0 1em">
<h1>dfrf studio</h1><form method="post" action="/login"><p>{}</p><label>Password
<input name="password" type="password" autofocus autocomplete="current-password"></label>
<button>Open</button></form></body></html>"""


class Guard:
    """Lets requests through that name this server and come from its page, with its cookie.

    A name that somebody else's DNS gives for this machine is none of this server's: otherwise any
    page could read it through such a name.

    Args:
        token: the secret in the address that was printed; or a password, which a form asks for.
        host, port: that it listens at.
        password: whether it is one.
    """

    def __init__(self, app: ASGIApp, *, token: str, host: str, port: int, password: bool) -> None:
        self.app, self.token, self.password = app, token, password
        self.names = {*LOCAL, *(() if host in LOCAL else (host, socket.gethostname().lower()))}
        self.local = host in LOCAL
        # Cookies know no ports: another server of this machine has its own.
        self.cookie, self.session = f"dfrf-studio-{port}", secrets.token_urlsafe(32)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request = Request(scope, receive)

        async def sending(message: dict) -> None:  # type: ignore[type-arg]
            if message["type"] == "http.response.start":
                own = [(k.encode(), v.encode()) for k, v in HEADERS.items()]
                kept = [pair for pair in message["headers"] if pair[0].decode() not in HEADERS]
                message = {**message, "headers": [*kept, *own]}
            await send(message)

        try:
            refused = await self._refusal(request)
        except ValueError:  # as of the host `[::1`
            refused = PlainTextResponse("Its head has an address or a number that is none.", 400)
        await (refused or self.app)(scope, receive, sending)  # type: ignore[arg-type]

    async def _refusal(self, request: Request) -> Response | None:
        """The answer to a request that is not let through."""
        if foreign := self._foreign(request):
            return foreign
        query, head = request.query_params, request.method in SAFE
        if request.url.path == "/login" and self.password and not head:
            return await self._login(request)
        cookie = request.cookies.get(self.cookie, "")
        if hmac.compare_digest(cookie.encode(), self.session.encode()):
            return RedirectResponse("/", 303) if "token" in query else None
        if request.url.path == "/" and head and self.password:
            return self._asked("This page needs the password that the server was started with.")
        if request.url.path == "/" and head and self._is_secret(query.get("token", "")):
            return self._opened()
        return PlainTextResponse("Open the address that `dfrf studio` printed.", 401)

    async def _login(self, request: Request) -> Response:
        """The answer to a password."""
        given = parse_qs((await request.body()).decode(errors="replace")).get("password", [""])
        if self._is_secret(given[0]):
            return self._opened()
        await asyncio.sleep(WRONG_S)  # so that nobody tries many
        return self._asked("Wrong password.")

    def _foreign(self, request: Request) -> Response | None:
        """The answer to a request for another server, of another page, or too large."""
        host, origin = (request.headers.get(name) for name in ("host", "origin"))
        if not self._named(host or ""):
            return PlainTextResponse(f"This server is not called {(host or '')[:100]!r}.", 421)
        missing = origin is None and request.method not in SAFE
        if missing or (origin is not None and urlsplit(origin).netloc != host):
            return PlainTextResponse("Refused: the request comes from another page.", 403)
        unknown = "" if "transfer-encoding" in request.headers else "0"
        length = request.headers.get("content-length", unknown)
        if not (length.isdigit() and int(length) <= MOST_BODY):
            return PlainTextResponse(f"Larger than {MOST_BODY // 1000} kB.", 413)
        return None

    def _named(self, host: str) -> bool:
        name = (urlsplit(f"//{host}").hostname or "") if host else ""
        if name.lower() in self.names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return not self.local

    def _is_secret(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self.token.encode())

    def _asked(self, words: str) -> Response:
        return HTMLResponse(PASSWORD_PAGE.format(words), 401)

    def _opened(self) -> Response:
        answer = RedirectResponse("/", 303)
        answer.set_cookie(self.cookie, self.session, httponly=True, samesite="strict", path="/")
        return answer
