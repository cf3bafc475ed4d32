"""Headless Chromium, driven through its DevTools protocol as a person drives it."""

from __future__ import annotations

import base64
import itertools
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests import needs

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--hide-scrollbars", "--no-first-run"),
    *("--autoplay-policy=no-user-gesture-required", "--remote-debugging-pipe"),
)
CODES = {"ArrowUp": 38, "ArrowDown": 40, "ArrowLeft": 37, "ArrowRight": 39, "Delete": 46, "Tab": 9}
MOST_S = 60  # that a page is waited for
CTRL, SHIFT = 2, 8
# The program sees its ends of the pipes as files 3 and 4.
START = "import os, sys; os.dup2({0}, 3); os.dup2({1}, 4); os.execv(sys.argv[1], sys.argv[1:])"


class Browser:
    """One browser; its pages share their cookies."""

    def __init__(self, read: int, write: int) -> None:
        self.answers, self.commands = os.fdopen(read, "rb"), os.fdopen(write, "wb")
        self.numbers = itertools.count(1)
        self.targets: list[str] = []
        self.rest = b""

    def call(self, method: str, session: str = "", **params: Any) -> dict[str, Any]:
        """The answer to a command."""
        number = next(self.numbers)
        command = {"id": number, "method": method, "params": params}
        command |= {"sessionId": session} if session else {}
        self.commands.write(json.dumps(command).encode() + b"\0")
        self.commands.flush()
        while True:
            answer = self._next()
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return dict(answer["result"])

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self.rest:
            more = self.answers.read1(1 << 16)
            assert more, "the browser ended"
            self.rest += more
        text, _, self.rest = self.rest.partition(b"\0")
        return dict(json.loads(text))

    def open(self, address: str, width: int = 1440, height: int = 900, dark: bool = False) -> Page:
        """A page in a tab of its own."""
        target = self.call("Target.createTarget", url="about:blank", newWindow=True)["targetId"]
        self.targets.append(target)
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, session)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        page.call("Emulation.setEmulatedMedia", features=[scheme])
        page.resize(width, height)
        page.call("Page.enable")
        page.call("Page.navigate", url=address)
        return page

    def close_pages(self) -> None:
        """Close all of them."""
        while self.targets:
            self.call("Target.closeTarget", targetId=self.targets.pop())


class Page:
    """A page in the browser."""

    def __init__(self, browser: Browser, session: str) -> None:
        self.browser, self.session = browser, session

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """The answer to a command."""
        return self.browser.call(method, self.session, **params)

    def resize(self, width: int, height: int) -> None:
        """Another size of the window."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def run(self, code: str) -> Any:
        """The value of a script in the page; promises are waited for."""
        found = self.call(
            "Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, code: str) -> Any:
        """The first value of an expression that is true, however long that takes."""
        waited = f"""new Promise((found, failed) => {{
          const end = Date.now() + {1000 * MOST_S};
          const look = () => {{
            let value; try {{ value = ({code}); }} catch {{ value = null; }}
            if (value) found(value);
            else if (Date.now() > end) failed(new Error("waited in vain"));
            else setTimeout(look, 20);
          }};
          look();
        }})"""
        try:
            return self.run(waited)
        except AssertionError as error:  # the page was loaded anew in the meantime
            if "navigated" not in str(error) and "destroyed" not in str(error):
                raise
            return self.run(waited)

    def place(self, query: str) -> tuple[float, float]:
        """The middle of an element."""
        box = self.run(
            f"(() => {{ const tag = document.querySelector({query!r});"
            "tag.scrollIntoView({block: 'nearest'}); const b = tag.getBoundingClientRect();"
            "return [b.x + b.width / 2, b.y + b.height / 2] })()"
        )
        return box[0], box[1]

    def drag(self, query: str, across: float, down: float = 0) -> None:
        """Drag an element with the mouse."""
        x, y = self.place(query)
        self._mouse("mousePressed", x, y)
        for k in range(1, 6):
            self._mouse("mouseMoved", x + across * k / 5, y + down * k / 5)
        self._mouse("mouseReleased", x + across, y + down)

    def click(self, query: str) -> None:
        """Click an element with the mouse."""
        x, y = self.place(query)
        self._mouse("mousePressed", x, y)
        self._mouse("mouseReleased", x, y)

    def press(self, key: str, modifiers: int = 0) -> None:
        """Press a key."""
        text = {"text": key} if len(key) == 1 and not modifiers else {}
        code = CODES.get(key, ord(key.upper()[0]))
        for kind in ("keyDown", "keyUp"):
            own = text if kind == "keyDown" else {}
            self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                windowsVirtualKeyCode=code,
                modifiers=modifiers,
                **own,
            )

    def picture(self, path: Path) -> None:
        """Write what is seen as PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))

    def double_click(self, x: float, y: float) -> None:
        """Click a place twice."""
        for count in (1, 2):
            self._mouse("mousePressed", x, y, count)
            self._mouse("mouseReleased", x, y, count)

    def _mouse(self, kind: str, x: float, y: float, count: int = 1) -> None:
        buttons = 0 if kind == "mouseReleased" else 1
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            button="left",
            buttons=buttons,
            clickCount=count,
        )


@contextmanager
def browser(folder: Path) -> Iterator[Browser]:
    """A browser with a profile in a folder."""
    theirs_in, ours_out = os.pipe()
    ours_in, theirs_out = os.pipe()
    program = needs.chromium()
    call = [sys.executable, "-c", START.format(theirs_in, theirs_out), program, *FLAGS]
    running = subprocess.Popen(
        [*call, f"--user-data-dir={folder}"],
        pass_fds=(theirs_in, theirs_out),
        stderr=subprocess.DEVNULL,
    )
    os.close(theirs_in)
    os.close(theirs_out)
    found = Browser(ours_in, ours_out)
    try:
        yield found
    finally:
        running.kill()
        running.wait()
        found.answers.close()
        found.commands.close()
