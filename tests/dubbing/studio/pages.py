"""The page as tests see it: when it is ready, what it holds, and what is saved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.keys import yaml_lines
from tests.dubbing.studio.browser import Browser, Page
from tests.dubbing.studio.stand_in import FRAMES

FIRST, LAST = "ann_0000005-0000020", "ann_0000040-0000055"
READY = "window.studio?.desk.curves && document.querySelector('#curve canvas')"
SAVED = "document.getElementById('state').textContent.startsWith('Saved')"
LINES = "studio.desk.dub.lines.map((line) => line.edit)"
# Notes the numbers and marks of drafted frames.
WATCH = """window.marks = {}; studio.desk.addEventListener("frame", ({ detail }) => {
  if (detail.kind !== "draft") return;
  (window.drafted ||= []).push(detail.frame);
  window.marks[detail.frame] = detail.mark;
})"""


def opened(chromium: Browser, address: str, **size: Any) -> Page:
    page = chromium.open(address, **size)
    page.until(READY)
    page.until(f"studio.picture.missing('draft') === 0 && studio.desk.dub.frames === {FRAMES}")
    page.run(WATCH)
    return page


def edits(manifest: Path) -> list[dict[str, Any]]:
    path = edits_file(manifest, "it")
    return list(yaml_lines.read(path.read_text()).data) if path.exists() else []


def saved(page: Page, act: Callable[[], object]) -> list[dict[str, Any]]:
    """Do something that changes an edit, and wait until it is saved; gives all edits."""
    page.run("document.getElementById('state').textContent = ''")
    act()
    page.until(SAVED)
    return list(page.run(LINES))


def tab_to(page: Page, name: str, what: str = "") -> None:
    """Press Tab until something is in focus."""
    wanted = f"document.activeElement.className === {name!r}"
    wanted = f"document.activeElement.{what}" if what else wanted
    for _ in range(60):
        page.press("Tab")
        if page.run(wanted):
            return
    pytest.fail(f"no Tab leads to {name or what}")
