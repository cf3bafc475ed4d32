"""The page in headless Chromium: keys are dragged, lines are moved, and the draft follows."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from dubbing.batch.jobs import build
from dubbing.engine.graph.graph import Jobs
from dubbing.engine.running import runner
from dubbing.engine.running.runner import Options
from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.pipeline import PERSON
from tests import clips, fakes
from tests.dubbing.engine.listener import Listener
from tests.dubbing.studio.browser import CTRL, SHIFT, Browser, Page
from tests.dubbing.studio.stand_in import FRAMES, server, write_scene

pytestmark = pytest.mark.medium
FIRST, LAST = "ann_0000005-0000020", "ann_0000040-0000055"
READY = "window.studio?.desk.curves && document.querySelector('#curve canvas')"
SAVED = "document.getElementById('state').textContent === 'Saved'"
LINES = "studio.desk.dub.lines.map((line) => line.edit)"
# Notes the numbers and marks of drafted frames, and how red the picture is.
WATCH = """window.marks = {}; studio.desk.addEventListener("frame", ({ detail }) => {
  if (detail.kind !== "draft") return;
  (window.drafted ||= []).push(detail.frame);
  window.marks[detail.frame] = detail.mark;
})"""
RED = """[...studio.picture.canvas.getContext("2d").getImageData(0, 0, 32, 24).data]
  .reduce((sum, value, k) => k % 4 ? sum : sum + value, 0)"""

# A frame is painted a little after it came.
PAINTED = "studio.picture.painted.frame === 12 && studio.picture.painted.mark === window.marks[12]"


@pytest.fixture
def address(manifest: Path) -> Iterator[str]:
    with server(manifest) as found:
        yield found


@pytest.fixture
def page(chromium: Browser, address: str) -> Page:
    return opened(chromium, address)


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


def test_a_dragged_key_changes_the_file_and_the_frames(page: Page, manifest: Path) -> None:
    page.run("studio.timeline.seek(0.5)")  # frame 12
    page.until("studio.picture.frame === 12")
    saved(page, lambda: page.click("#shut"))
    page.until("(window.drafted || []).includes(12) && studio.picture.missing('draft') === 0")
    assert edits(manifest) == [{"line": 1, "keys": [{"at": 0.3, "strength": 0}]}]
    page.until(PAINTED)
    shut = page.run(RED)
    page.run("window.drafted = []")
    (first, _) = saved(page, lambda: page.drag("#curve .key", 0, -120))
    page.until("window.drafted.includes(12) && studio.picture.missing('draft') === 0")
    (key,) = first["keys"]
    assert key["strength"] > 0.8
    assert edits(manifest)[0]["keys"] == [pytest.approx(key)]
    page.until(PAINTED)
    assert page.run(RED) > shut + 1000
    drafted = page.run("window.drafted")
    assert sorted(drafted) == [10, 11, 12, 13, 14]  # nothing but what changed
    assert drafted[0] == 12  # first of all what is shown
    saved(page, lambda: page.drag("#curve .key", 100))
    moved = edits(manifest)[0]["keys"][0]["at"]
    assert moved > 0.35
    saved(page, lambda: page.press("Delete"))  # the key is in focus since it was dragged
    assert edits(manifest) == []


def test_what_is_measured_in_the_draft_follows_it(page: Page) -> None:
    opening = "studio.picture.measured(12).opening"
    open_ = page.until(opening)
    page.run(
        """studio.desk.addEventListener("frame", ({ detail: { kind, frame } }) => {
        if (kind === "measured") (window.measured ||= []).push(frame) })"""
    )
    page.run("studio.timeline.seek(0.5)")  # frame 12
    saved(page, lambda: page.click("#shut"))
    page.until("window.measured?.length >= 5")
    assert page.until(opening) < open_
    assert sorted(page.run("window.measured")) == [10, 11, 12, 13, 14]  # those that changed
    assert page.run("studio.picture.measured(30)") == {}  # beside the line


def test_a_drag_outlives_what_comes_in_the_meantime(page: Page) -> None:
    saved(page, lambda: page.click("#shut"))
    x, y = page.place("#curve .key")
    page._mouse("mousePressed", x, y)
    page._mouse("mouseMoved", x, y - 40)
    page.run("studio.timeline.lay()")
    page._mouse("mouseMoved", x, y - 80)
    (first, _) = saved(page, lambda: page._mouse("mouseReleased", x, y - 80))
    assert first["keys"][0]["strength"] > 0.5
    assert page.run("document.querySelectorAll('#curve .key').length") == 1


def test_a_dragged_word_is_moved_and_no_other(page: Page, manifest: Path) -> None:
    word = "[data-block='word 0']"
    page.until(f"document.querySelector({word!r}).textContent === 'One'")
    scale = page.run(
        "document.getElementById('wave').clientWidth"
        " / (studio.timeline.sight[1] - studio.timeline.sight[0])"
    )
    (first, last) = saved(page, lambda: page.drag(word, 0.04 * scale))
    (part,) = first["moved"]
    assert part == {"start": 0.12, "end": 0.32, "shift": pytest.approx(40, abs=2)}
    assert last["moved"] == []
    place = f"parseFloat(document.querySelector({word!r}).style.left) / {scale}"
    start = page.run(place) + page.run("studio.timeline.sight[0]")
    assert start == pytest.approx(0.2 + 0.12 + part["shift"] / 1000, abs=0.01)
    (first, _) = saved(page, lambda: page.press("ArrowRight"))  # it stays in focus
    assert first["moved"][0]["shift"] == part["shift"] + 10
    assert edits(manifest) == [{"line": 1, "moved": first["moved"]}]
    # An end of the block moves the first frame of the line, or the last one.
    (first, _) = saved(page, lambda: page.drag("[data-block=end]", -0.06 * scale))
    end = first["moved"][1]
    assert end == {"start": 0.56, "end": 0.6, "shift": pytest.approx(-60, abs=2)}
    saved(page, lambda: page.press("Delete"))
    page.run("document.querySelector('[name=moved]').value = '0.2-0.4 -30'")
    change = "document.querySelector('[name=moved]').dispatchEvent(new Event('change'))"
    saved(page, lambda: page.run(change))
    typed = {"start": 0.2, "end": 0.4, "shift": -30}
    assert edits(manifest) == [{"line": 1, "moved": [typed]}]
    # The word lies in that part by now, which moves as a whole.
    (first, _) = saved(page, lambda: page.drag(word, 0.02 * scale))
    assert first["moved"] == [{**typed, "shift": pytest.approx(-10, abs=2)}]


def test_a_dragged_block_shifts_the_mouth(page: Page, manifest: Path) -> None:
    (first, last) = saved(page, lambda: page.drag(f"[data-block={FIRST!r}]", 100))
    assert last["shift"] == 0
    assert edits(manifest) == [{"line": 1, "shift": first["shift"]}]
    scale = page.run("document.getElementById('wave').clientWidth") / page.run(
        "studio.timeline.sight[1] - studio.timeline.sight[0]"
    )
    assert first["shift"] == pytest.approx(100 / scale * 1000, abs=2)
    saved(page, lambda: page.press("z", CTRL))
    assert edits(manifest) == []
    saved(page, lambda: page.press("z", CTRL | SHIFT))
    assert edits(manifest)[0]["shift"] == first["shift"]


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


def tab_to(page: Page, name: str, what: str = "") -> None:
    """Press Tab until something is in focus."""
    wanted = f"document.activeElement.className === {name!r}"
    wanted = f"document.activeElement.{what}" if what else wanted
    for _ in range(60):
        page.press("Tab")
        if page.run(wanted):
            return
    pytest.fail(f"no Tab leads to {name or what}")


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


def test_two_takes_are_kept_chosen_and_compared(page: Page, manifest: Path) -> None:
    def kept() -> Any:
        (edit,) = yaml_lines.read(edits_file(manifest, "it").read_text()).data
        return edit

    chosen = "studio.desk.line.edit.take === {!r} && studio.desk.line.edit.strength === {}"
    assert page.run("document.getElementById('takes').hidden")
    page.run("studio.desk.change(studio.desk.line, { strength: 0.5, note: 'soft' })")
    page.until(SAVED)
    page.click("#keep")
    page.until(f"{chosen.format('1', 0.5)} && studio.desk.line.takes['1']")
    page.run("studio.desk.change(studio.desk.line, { strength: 1.25, shift: 40 })")
    page.until("studio.desk.line.takes['1'].strength === 1.25")
    wide = {"shift": 40, "strength": 1.25}
    whole = {"line": 1, "strength": 0.5, "note": "soft", "take": "1", "takes": {"1": wide}}
    assert kept() == whole
    assert load(manifest).dubs["it"].cues[0].edit.in_words() == (
        "take 1, the mouth 40 ms later, strength 1.25: soft"
    )
    # A key goes back and forth; the draft follows, and nothing is lost.
    page.press("x")
    page.until(f"{chosen.format('', 0.5)} && studio.desk.line.strengths[3] === 0.5")
    assert kept() == {key: value for key, value in whole.items() if key != "take"}
    page.press("x")
    page.until(f"{chosen.format('1', 1.25)} && studio.desk.line.strengths[3] === 1.25")
    assert kept() == whole
    page.run("document.querySelector('[name=take]').value = ''")
    page.run("document.querySelector('[name=take]').dispatchEvent(new Event('change'))")
    page.until(f"{chosen.format('', 0.5)} && studio.desk.line.strengths[3] === 0.5")
    page.press("z", CTRL)
    page.until(f"{chosen.format('1', 1.25)} && studio.desk.line.strengths[3] === 1.25")
    page.until(SAVED)
    assert kept() == whole


def test_a_laugh_of_the_film_is_kept(page: Page, manifest: Path) -> None:
    """Frames beside it fade, and no other is drafted again."""
    page.run("document.querySelector('[name=film]').value = '0.2-0.32'")
    page.run("document.querySelector('[name=film]').dispatchEvent(new Event('change'))")
    page.until(f"studio.desk.line.edit.film_mouth.length === 1 && {SAVED}")
    assert edits(manifest) == [{"line": 1, "film_mouth": [{"start": 0.2, "end": 0.32}]}]
    page.until("window.drafted?.length >= 9 && studio.picture.missing('draft') === 0")
    assert sorted(set(page.run("window.drafted"))) == [*range(5 + 5 - 3, 5 + 8 + 3)]
    # Its ends are dragged, or moved by keys.
    (first, _) = saved(page, lambda: page.drag("[data-block='0 end']", 60))
    (span,) = first["film_mouth"]
    assert span["start"] == 0.2
    assert 0.34 < span["end"] < 0.6
    saved(page, lambda: page.press("ArrowLeft"))
    assert edits(manifest)[0]["film_mouth"] == [
        {"start": 0.2, "end": pytest.approx(span["end"] - 0.04)}
    ]
    tab_to(page, "edge")
    saved(page, lambda: page.drag("[data-block='0 start']", 2000))  # never past the other
    (span,) = edits(manifest)[0]["film_mouth"]
    assert span["end"] - span["start"] == pytest.approx(0.04, abs=0.011)
    saved(page, lambda: page.press("Delete"))
    assert edits(manifest) == []
    saved(page, lambda: page.press("z", CTRL))
    page.run("document.querySelector('[name=film]').value = '0.5-0.2'")
    page.run("document.querySelector('[name=film]').dispatchEvent(new Event('change'))")
    assert not page.run("document.querySelector('[name=film]').checkValidity()")
    assert edits(manifest)[0]["film_mouth"] == [span]


def test_a_take_with_another_recording_is_heard(page: Page, manifest: Path) -> None:
    clips.write_sound(manifest.parent / "again.wav", 0.3, hertz=900)
    again = str(manifest.parent / "again.wav")
    edits_file(manifest, "it").write_text("{line: 1, takes: {again: {audio: again.wav}}}")
    page.until(f"studio.desk.line.takes.again?.audio === {again!r}")
    before = page.run("[studio.desk.dub.heard, studio.desk.curves.peaks]")
    page.press("x")
    page.until("studio.desk.line.edit.take === 'again' && studio.desk.curves")
    page.until(f"studio.desk.dub.heard !== {before[0]!r} && {READY}")
    assert page.run("studio.desk.curves.peaks") != before[1]
    page.press("x")
    page.until(f"studio.desk.dub.heard === {before[0]!r} && {READY}")
    assert page.run("studio.desk.curves.peaks") == before[1]
    (edit,) = edits(manifest)
    assert edit == {"line": 1, "takes": {"again": {"audio": "again.wav"}}}


def test_a_style_is_chosen(page: Page, manifest: Path) -> None:
    marks = "window.marks[12]"
    softer = "document.querySelector('[name=style]').value = 'softer'"
    change = "document.querySelector('[name=style]').dispatchEvent(new Event('change'))"
    saved(page, lambda: page.run(f"{softer}; {change}"))
    assert edits(manifest) == [{"line": 1, "style": "softer"}]
    page.until(marks)  # drafted again
    assert page.run("document.querySelector('#lines .tag').textContent") == "edited"
    saved(page, lambda: page.click("#reset"))
    assert edits(manifest) == []


def test_labials_become_keys_that_can_be_taken_back(page: Page, manifest: Path) -> None:
    saved(page, lambda: page.click("#labials"))
    shut = [{"at": 0.12, "strength": 0}, {"at": 0.4, "strength": 0}]
    assert edits(manifest) == [{"line": 1, "keys": shut}]
    assert page.run("document.querySelectorAll('#curve .key').length") == 2
    page.click("#labials")
    page.until("document.getElementById('state').textContent === 'No new key is needed'")
    saved(page, lambda: page.press("z", CTRL))
    assert edits(manifest) == []


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
