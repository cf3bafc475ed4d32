"""The page in headless Chromium, opened as a file: what a director sees, types and plays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.dubbing.report.pages import DUBS, SOURCE, write_everything
from tests.dubbing.studio.browser import Browser, Page

pytestmark = pytest.mark.medium
WORST_FIRST = ["still", "gone", "shot10", "early", "quiet", "weak", "fine", "shot9"]
VERDICTS = {"failed": WORST_FIRST[:2], "warned": WORST_FIRST[2:4], "unjudged": ["quiet"]}
VERDICTS["passed"] = WORST_FIRST[5:]
SHOWN = "[...document.querySelectorAll('#lineup button')].map((one) => one.dataset.name)"
TEXT = "document.getElementById('{}').innerText"
READY = "result.readyState > 1 && (find('views').disabled || source.readyState > 1)"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_everything(tmp_path_factory.mktemp("browser"))


@pytest.fixture
def page(chromium: Browser, report: Path) -> Page:
    return opened(chromium, report)


def opened(chromium: Browser, report: Path, dub: str = "still", **size: Any) -> Page:
    page = chromium.open(f"{report.as_uri()}#dub-{dub}", **size)
    page.until(f"name === {dub!r} && ({READY})")
    page.run("localStorage.clear(); notes = {}; lines()")
    return page


def text(page: Page, part: str) -> str:
    return " ".join(str(page.run(TEXT.format(part))).split())


def test_the_worst_come_first_and_are_found_and_sorted(page: Page) -> None:
    assert page.run(SHOWN) == WORST_FIRST
    for verdict, hidden in VERDICTS.items():
        tick = f"[value={verdict}]"
        page.click(tick)
        assert page.run(SHOWN) == [name for name in WORST_FIRST if name not in hidden]
        page.click(tick)

    def given(field: str, value: str) -> list[str]:
        page.run(f"tools.{field}.value = {value!r}; lay()")
        return list(page.run(SHOWN))

    assert [given("name", words) for words in ("EA", "bob", "nobody", "")] == [
        ["early", "weak"],
        ["quiet"],
        [],
        WORST_FIRST,
    ]
    by_name = ["early", "fine", "gone", "quiet", "shot9", "shot10", "still", "weak"]
    assert given("sort", "name") == by_name
    assert given("sort", "place") == [name for name, _, _ in DUBS]


def test_a_dub_is_told_in_words_and_its_warnings_stand_beside_it(page: Page) -> None:
    assert "failed measured still" in text(page, "about")
    told = text(page, "told")
    assert "01:00:01:00" in told
    assert "Dubbed in part: 80 % of the frames dubbed" in told
    assert "The film's own face in frames: covered 40-44" in told
    page.press("]")
    assert "What to do: try again" in text(page, "about")
    page.run("choose('fine')")
    assert "The film's own face in frames: turned 3-9" in text(page, "about")
    assert "With the visible mark" not in text(page, "about")
    assert "invisible mark 0123456789abcdef" in text(page, "about")
    assert "consent" in text(page, "people").lower()


def test_takes_stand_beside_their_line(page: Page) -> None:
    told = page.run("document.getElementById('told').innerText")
    assert "Take without a name: not made as it is now" in told
    assert "Take late, chosen: in sync, 40 ms late, mouth follows the words: 90 %" in told


def test_source_and_dub_play_together_by_keys(page: Page) -> None:
    """The source begins at 1.5 s with the dub, the second line at 0.5 s of it."""
    assert page.run("decodeURIComponent(source.src).split('/').pop()") == Path(SOURCE).name
    hidden = "[source, result].map((video) => video.classList.contains('unseen-film'))"
    assert page.run(hidden) == [True, False]
    page.press("a")
    assert page.run(hidden) == [False, True]
    page.press("b")
    page.press("s")
    assert page.run("[source.muted, result.muted]") == [False, True]
    page.press("j")
    page.until(
        "Math.abs(result.currentTime - 0.5) < 0.01 && Math.abs(source.currentTime - 2) < 0.01"
    )
    page.press(".")
    page.until("Math.abs(result.currentTime - 13.5 / 25) < 0.001")
    page.press(",")
    page.until("Math.abs(result.currentTime - 12.5 / 25) < 0.001")
    page.press(" ")
    page.until("result.currentTime > 0.7 && source.currentTime > 2.1")
    # Looped, it comes back from the end of its line, 2.4 s.
    page.press("l")
    page.run("result.currentTime = 2.3")
    page.until("result.currentTime < 2.2 && !result.seeking")
    assert page.run("result.currentTime") >= 0.5  # not from the end of the video to its beginning
    page.press("]")
    assert page.run("result.paused && source.paused")


def test_notes_come_out_as_a_file_and_outlive_the_page(chromium: Browser, report: Path) -> None:
    page = opened(chromium, report)
    assert page.run("find('save').disabled")
    page.press("j")
    page.click("#note")
    for letter in "too soft":
        page.press(letter)
    page.click("[name=status][value=redo] + span")
    expected = {"dub": "still", "line": 2, "cue": "ann_2", "told": "told 2"}
    expected |= {"in": "01:00:02:00", "note": "too soft", "status": "redo"}
    assert page.run("written()") == [expected]
    assert page.run("find('save').disabled") is False
    again = chromium.open(f"{report.as_uri()}#dub-still")
    again.until(READY)
    assert again.run("written()") == [expected]
    again.press("t")
    assert again.run("notes.still.ann_1.note") == "0:00.00: "


def test_where_videos_are_missing_the_page_says_so(chromium: Browser, report: Path) -> None:
    page = opened(chromium, report, "weak")
    page.run("dub.source = 'gone.mp4'; choose('weak')")
    page.until("find('views').disabled")
    assert page.run("find('picture').hidden") is False
    page.run("dub.video = 'gone.mp4'; choose('weak')")
    page.until("!find('lost').hidden")
    assert "dfrf share" in text(page, "lost")


@pytest.mark.parametrize("width", [390, 1440])
def test_nothing_is_wider_than_the_window(chromium: Browser, report: Path, width: int) -> None:
    page = opened(chromium, report, width=width, dark=width == 390)
    widths = "[document.documentElement.scrollWidth, innerWidth]"
    assert page.run(widths) == [width, width]
    page.run("for (const part of document.querySelectorAll('details')) part.open = true")
    assert page.run(f"new Promise((go) => setTimeout(() => go({widths}), 50))") == [width, width]
    # A timecode stands on one line.
    assert page.run(
        "[...document.querySelectorAll('h2 .time')].every((one) => one.getClientRects()[1] == null)"
    )
    assert page.run("document.querySelectorAll('#sync .u-title').length") == 1
