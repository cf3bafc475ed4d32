"""The page in headless Chromium: keyboard, several windows, phones, many lines, a lost server."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from dubbing.batch.jobs import build
from dubbing.engine.graph.graph import Jobs
from dubbing.engine.running import runner
from dubbing.engine.running.runner import Options
from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.manifest import load
from dubbing.pipeline import PERSON
from tests import fakes
from tests.dubbing.engine.listener import Listener
from tests.dubbing.studio.browser import Browser, Page
from tests.dubbing.studio.pages import LINES, edits, opened, saved, tab_to
from tests.dubbing.studio.stand_in import FRAMES, server, write_scene

pytestmark = pytest.mark.medium


def test_all_of_it_works_by_keyboard(page: Page, manifest: Path) -> None:
    for key in ".....":
        page.press(key)
    page.until("studio.picture.frame === 10")
    saved(page, lambda: page.press("c"))
    tab_to(page, "key")
    saved(page, lambda: page.press("ArrowUp"))
    saved(page, lambda: page.press("ArrowRight"))
    assert edits(manifest)[0]["keys"] == [{"at": 0.26, "strength": 0.05}]
    assert page.run("document.activeElement.className") == "key"
    tab_to(page, "", "dataset.block")
    (first, _) = saved(page, lambda: page.press("ArrowLeft"))
    assert first["shift"] == -10
    page.press("n")
    assert page.run("studio.desk.line.line") == 3
    tab_to(page, "", "name === 'status'")
    (_, last) = saved(page, lambda: page.press("ArrowRight"))
    assert last["status"] == "approved"
    page.press("n")
    assert page.run("studio.desk.line.line") == 1
    for key, shown in (("a", "film"), ("d", "draft"), ("b", "draft")):  # there is no dub yet
        page.press(key)
        assert page.run("studio.picture.view") == shown
    tab_to(page, "", "name === 'note'")
    for key in "an abc":
        page.press(key)
    (first, _) = saved(page, lambda: page.press("Tab"))
    assert first["note"] == "an abc"
    assert [one.get("status") for one in edits(manifest)] == [None, "approved"]


def test_a_second_page_sees_what_the_first_saved(
    chromium: Browser, page: Page, address: str, manifest: Path
) -> None:
    other = opened(chromium, address)
    saved(page, lambda: page.click("#shut"))
    other.until(f"({LINES})[0].keys.length === 1")
    other.until("window.drafted && studio.picture.missing('draft') === 0")
    edits_file(manifest, "it").write_text("{line: 3, strength: 0.5}")  # by hand
    for one in (page, other):
        one.until(f"({LINES})[1].strength === 0.5")
    # A page that has not heard of it yet.
    page.run("studio.desk.dub.revision = 'old'")
    page.run("document.querySelector('[name=status][value=redo]').click()")
    page.until("document.getElementById('state').textContent.includes('saved elsewhere')")
    assert edits_file(manifest, "it").read_text() == "{line: 3, strength: 0.5}"
    page.until(f"({LINES})[0].status === 'open'")


def test_what_was_asked_for_before_a_save_does_not_undo_it(page: Page) -> None:
    page.run(
        """const real = fetch; window.fetch = async (path, options = {}) => {
        const answer = await real(path, options);
        if (path.endsWith("/it") && !options.method) await new Promise((go) => { window.go = go; });
        return answer }"""
    )
    page.run("void studio.desk.reload('old')")
    page.until("window.go")
    saved(page, lambda: page.click("#shut"))
    page.run("window.go(); new Promise((go) => setTimeout(go, 50))")
    assert len(page.run(LINES)[0]["keys"]) == 1
    redo = "document.querySelector('[name=status][value=redo]').click()"
    saved(page, lambda: page.run(redo))  # it is not refused


def test_a_lost_server_is_said_and_found_again(chromium: Browser, manifest: Path) -> None:
    with server(manifest) as address:
        page = opened(chromium, address)
    page.until("!document.getElementById('banner').hidden")
    assert "does not answer" in page.run("document.getElementById('banner').textContent")
    page.run("document.querySelector('[name=status][value=redo]').click()")
    page.until("document.getElementById('state').textContent.startsWith('Not saved')")
    assert page.run(LINES)[0]["status"] == "open"
    assert edits(manifest) == []
    port = urlsplit(address).port or 0
    with server(manifest, port) as again:
        page.until("document.getElementById('banner').textContent.startsWith('Open the address')")
        other = opened(chromium, again)  # the new token's cookie
        page.until("document.getElementById('banner').hidden")
        saved(page, lambda: page.run("document.querySelector('[name=status][value=redo]').click()"))
        other.until(f"({LINES})[0].status === 'redo'")


@pytest.mark.parametrize("dark", [False, True])
def test_nothing_is_wider_than_a_phone_and_all_words_can_be_read(
    chromium: Browser, address: str, dark: bool
) -> None:
    page = opened(chromium, address, width=390, height=844, dark=dark)
    saved(page, lambda: page.run("document.getElementById('shut').click()"))
    widths = page.run(
        "[document.documentElement.clientWidth, document.documentElement.scrollWidth]"
    )
    assert widths == [390, 390]
    low = page.run(CONTRAST)
    assert json.loads(low) == []


def test_the_sound_goes_where_the_picture_goes(page: Page) -> None:
    """Steps come faster than the player goes anywhere."""
    page.run(
        """(() => { const media = HTMLMediaElement.prototype;
        const real = Object.getOwnPropertyDescriptor(media, "readyState");
        studio.timeline.seek(0.3);
        const get = () => { Object.defineProperty(media, "readyState", real); return 1; };
        Object.defineProperty(media, "readyState", { get, configurable: true });
        studio.timeline.seek(0.58) })()"""
    )
    cursor = """[...document.querySelectorAll("#wave div")].find((tag) => tag.shadowRoot)
      .shadowRoot.querySelector(".cursor")"""
    page.until(f"Math.abs(parseFloat({cursor}.style.left) / 100 * {FRAMES} - 14.5) < 0.1")


def test_what_is_in_focus_is_in_sight_and_where_the_curve_has_it(page: Page) -> None:
    saved(page, lambda: page.click("#shut"))  # a key at the beginning of the line
    for _ in range(3):
        page.press("+")
    beside = """(() => { const find = (tag) => document.querySelector(tag);
      const [end, all] = [find("[data-block=end]"), find("#wave")].map((tag) =>
        tag.getBoundingClientRect());
      return [end.right - all.left, all.right - end.left, find("#lane").scrollLeft] })()"""
    assert page.run(beside)[1] < 0  # the end of the line is out of sight
    tab_to(page, "", "dataset.block === 'end'")
    left, right, scrolled = page.run(beside)
    assert left > 0
    assert right > 0
    assert scrolled == 0
    assert page.run("studio.picture.frame") == 19
    tab_to(page, "key")
    assert page.run("studio.picture.frame") < 8
    assert page.run("document.activeElement.className") == "key"
    # It holds nobody back from going elsewhere, or from playing.
    page.run("studio.timeline.seek(0.7)")
    page.run("new Promise((go) => setTimeout(go, 50))")
    assert page.run("studio.picture.frame") == 17
    page.press(" ")
    page.until("document.getElementById('play').textContent === 'Pause'")


def test_a_width_fills_its_axis_and_an_opening_begins_at_nothing(page: Page) -> None:
    bounds = "import('/page/timeline.js').then(({ bounds }) => bounds([null, 0.5, 0.7], '%s'))"
    assert page.run(bounds % "width") == pytest.approx([0.5, 0.72])
    assert page.run(bounds % "opening") == pytest.approx([0, 0.77])


def test_long_words_neither_move_the_page_nor_leave_their_card(page: Page, manifest: Path) -> None:
    name = "a name of a take that is too long for a menu"
    edits_file(manifest, "it").write_text(f"{{line: 1, takes: {{{name}: {{shift: 40}}}}}}")
    page.until("!document.getElementById('takes').hidden")
    page.run("document.querySelector('[name=take]').options[0].textContent = '" + name + "'")
    high = "document.querySelector('header').offsetHeight"
    before = page.run(high)
    page.run(
        """document.getElementById("state").textContent =
        "Not saved: saved elsewhere in the meantime: look, then do it again";
        document.getElementById("making").textContent = "the_film: 17 of 20 stages, render 10%" """
    )
    assert page.run(high) == before
    page.run("document.querySelector('#dubs').options[0].textContent = '" + 3 * name + "'")
    page.resize(980, 900)
    page.until("document.documentElement.scrollWidth === 980")  # the plot follows a little later
    outside = page.run(
        """(() => { const end = document.getElementById("line").getBoundingClientRect().right;
        return [...document.querySelectorAll("#line *")].filter((tag) =>
          tag.checkVisibility() && tag.getBoundingClientRect().right > end).length })()"""
    )
    assert outside == 0


# Words whose contrast with what is behind them is below that of WCAG AA.
CONTRAST = """(() => {
  const parts = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const light = (colour) => parts(colour).slice(0, 3).map((v) => v / 255)
    .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const behind = (tag) => {
    for (; tag; tag = tag.parentElement) {
      const colour = getComputedStyle(tag).backgroundColor, [,,, opacity = 1] = parts(colour);
      if (opacity > 0.5) return colour;
    }
    return "rgb(255, 255, 255)";
  };
  const low = [];
  for (const tag of document.querySelectorAll("body *")) {
    const own = [...tag.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
    if (!own || !tag.checkVisibility() || tag.closest(".unseen, option")) continue;
    const [a, b] = [light(getComputedStyle(tag).color), light(behind(tag))].sort((x, y) => y - x);
    if ((a + 0.05) / (b + 0.05) < 4.5) low.push([tag.tagName, tag.textContent.slice(0, 30)]);
  }
  return JSON.stringify(low);
})()"""


def test_two_hundred_lines(
    chromium: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All are in the list; any of them is a key or a click away, and is saved as one of few is."""
    count, step = 200, 2
    manifest = write_scene(tmp_path, count * step)
    cues = [
        f"{k}\n00:00:{at // 25:02},{at % 25 * 40:03} --> 00:00:{(at + 1) // 25:02},"
        f"{(at + 1) % 25 * 40:03}\nANN: Line {k}.\n"
        for k, at in enumerate(range(0, count * step, step), 1)
    ]
    (tmp_path / "it.srt").write_text("\n".join(cues))
    fakes.install(monkeypatch.setattr)
    people = [job for job in build(load(manifest), draft=True).all() if job.kind == PERSON]
    runner.run(Jobs.of(people), Options(), Listener())
    with server(manifest) as address:
        page = chromium.open(address)
        page.until(f"document.querySelectorAll('#lines button').length === {count}")
        page.press("j")
        page.until("studio.desk.line.line === 2")
        page.click("#lines button:last-child")
        page.until(f"studio.desk.line.line === {count}")
        inside = page.run(
            """(() => { const place = (tag) => document.querySelector(tag).getBoundingClientRect();
            const [line, all] = [place("#lines [aria-current]"), place("#lines")];
            return line.top >= all.top - 1 && line.bottom <= all.bottom + 1 })()"""
        )
        assert inside
        saved(page, lambda: page.run("document.querySelector('[name=status][value=redo]').click()"))
        assert edits(manifest) == [{"line": count, "status": "redo"}]
        page.press("n")
        page.until("studio.desk.line.line === 1")
        counts = page.run("document.getElementById('counts').textContent")
        assert counts == f"{count} lines: {count - 1} open, 0 approved, 1 redo"


def test_the_dub_is_made_and_its_verdict_stands_beside_the_line(page: Page, manifest: Path) -> None:
    assert page.run("document.querySelector('#views [value=dub]').disabled")
    page.click("#make")
    page.until("document.getElementById('make').textContent === 'Stop'")
    page.until("document.getElementById('making').textContent === 'it: made'")
    page.until("studio.desk.dub.dubbed && !document.querySelector('#views [value=dub]').disabled")
    assert (manifest.parent / "out" / "it.mp4").is_file()
    assert page.run("document.getElementById('make').textContent") == "Make the dub"
    page.press("b")
    page.until("studio.picture.painted.kind === 'dub'")
