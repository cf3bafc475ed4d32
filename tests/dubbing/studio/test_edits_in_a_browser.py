"""Edits in headless Chromium: what is dragged or chosen is saved, and the draft follows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from tests import clips
from tests.dubbing.studio.browser import CTRL, SHIFT, Page
from tests.dubbing.studio.pages import FIRST, READY, SAVED, edits, saved, tab_to

pytestmark = pytest.mark.medium
# How red the picture is.
RED = """[...studio.picture.canvas.getContext("2d").getImageData(0, 0, 32, 24).data]
  .reduce((sum, value, k) => k % 4 ? sum : sum + value, 0)"""

# A frame is painted a little after it came.
PAINTED = "studio.picture.painted.frame === 12 && studio.picture.painted.mark === window.marks[12]"


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


def test_a_double_click_adds_a_key_where_it_is(page: Page) -> None:
    left, top, wide, high = page.run(
        """(() => { const tag = document.querySelector("#curve .u-over");
        tag.scrollIntoView({ block: "nearest" }); const box = tag.getBoundingClientRect();
        return [box.x, box.y, box.width, box.height] })()"""
    )
    low, end = page.run("studio.timeline.sight")
    x = left + (0.5 - low) / (end - low) * wide
    (first, _) = saved(page, lambda: page.double_click(x, top + high * 0.25))
    (key,) = first["keys"]
    assert key["at"] == pytest.approx(0.3, abs=0.011)  # the line begins at .2 s
    assert key["strength"] == pytest.approx(1.5 - 0.25 * 1.65, abs=0.03)


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


def test_a_draft_that_is_there_before_the_curves_is_measured(page: Page) -> None:
    page.until("studio.picture.measured(12).opening")
    page.run("window.curves = studio.desk.curves; studio.desk.curves = null")
    page.run("studio.timeline.seek(0.5)")  # frame 12
    saved(page, lambda: page.click("#shut"))
    page.until("studio.picture.missing('draft') === 0 && window.marks[12]")
    assert page.run("studio.picture.measured(12)") == {}
    page.run("studio.desk.curves = window.curves; studio.desk.tell('curves')")
    page.until("studio.picture.measured(12).opening")


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
    own = page.run("studio.timeline.wanted().map((one) => one === null)")
    assert own == [0.2 <= (k + 0.5) / 25 < span["end"] for k in range(15)]
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
    said = page.run("document.getElementById('state').textContent")
    assert said == "Saved: 2 new keys"
    shut = [{"at": 0.12, "strength": 0}, {"at": 0.4, "strength": 0}]
    assert edits(manifest) == [{"line": 1, "keys": shut}]
    assert page.run("document.querySelectorAll('#curve .key').length") == 2
    page.click("#labials")
    page.until("document.getElementById('state').textContent === 'No new key is needed'")
    saved(page, lambda: page.press("z", CTRL))
    assert edits(manifest) == []
