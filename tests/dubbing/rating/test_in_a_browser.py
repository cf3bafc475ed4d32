"""The page in headless Chromium, opened as a file: a person answers all pairs by the keyboard."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from dubbing.manifest.manifest import load
from dubbing.rating import answers as told
from dubbing.rating.pairs import PAGE, Key, write
from tests.dubbing.studio.browser import Browser, Page

pytestmark = pytest.mark.medium
SHOWN = "videos.map((video) => video.getAttribute('src'))"


@pytest.fixture(scope="module")
def rated(two: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Key]:
    folder = tmp_path_factory.mktemp("rate")
    return folder, write([load(path) for path in two], folder)[0]


@pytest.fixture
def page(chromium: Browser, rated: tuple[Path, Key]) -> Page:
    page = chromium.open((rated[0] / PAGE).as_uri())
    page.until("document.readyState === 'complete' && document.activeElement.id === 'person'")
    page.run("localStorage.clear(); kept = { person: '', of: {} }; find('person').value = ''")
    return page


def begin(page: Page, name: str = "Ann") -> None:
    for letter in name:
        page.press(letter)
    page.press("\r")
    page.until("!find('rate').hidden && videos.every((video) => video.readyState > 2)")


def saved(page: Page) -> tuple[str, str]:
    """Name and content of the file that the page hands over."""
    page.run("""URL.createObjectURL = (blob) => { window.blob = blob; return '#'; };
      HTMLAnchorElement.prototype.click = function () {
        blob.text().then((text) => { window.file = [this.download, text]; }); }""")
    page.press("\r")
    name, text = page.until("window.file")
    return name, text


def test_answers_of_the_keyboard_come_back_as_a_file(
    chromium: Browser, page: Page, rated: tuple[Path, Key], tmp_path: Path
) -> None:
    folder, key = rated
    begin(page, "Ann B")
    for pair, letter in zip(key["pairs"], "120", strict=False):
        assert page.run(SHOWN) == [pair["first"]["video"], pair["second"]["video"]]
        page.press(letter)
    assert page.run("find('done').hidden")
    # What was answered outlives the page, which goes on at the next pair.
    page = chromium.open((folder / PAGE).as_uri())
    page.until("document.activeElement === find('person') && find('person').value === 'Ann B'")
    page.press("\r")
    page.until("find('place').textContent === 'Pair 4 of 4, 3 answered'")
    page.press("ArrowLeft")
    page.until("find('place').textContent.startsWith('Pair 3')")
    assert page.run("buttons.map((one) => one.getAttribute('aria-pressed') === 'true')") == [
        *(False, True, False)
    ]
    page.press("2")
    page.press("1")
    page.until("!find('done').hidden && document.activeElement.id === 'save'")
    name, text = saved(page)
    assert name == "answers_Ann_B.json"
    (tmp_path / name).write_text(text)
    found = told.read([tmp_path / name], key)
    assert [(one.person, one.pair["id"]) for one in found] == [
        ("Ann B", pair["id"]) for pair in key["pairs"]
    ]
    assert [one.first for one in found] == [1, 0, 0, 1]


def test_both_play_in_step_and_loop(page: Page) -> None:
    """The pair that is shown is of 0.8 to 0.9 s and 1.6 to 1.7 s."""
    begin(page)
    page.until("videos.every((video) => !video.paused && video.currentTime > 0.1)")
    assert page.run("videos.map((video) => video.muted)") == [False, True]
    page.press(" ")
    page.until("videos.every((video) => video.paused && !video.seeking)")
    page.run("videos[1].currentTime = 0.05")  # the one that is heard is beyond
    page.until("!videos[1].seeking && videos[0].currentTime - videos[1].currentTime < 0.04")
    page.press("s")
    assert page.run("videos.map((video) => video.muted)") == [True, False]
    # The longer one is heard; at its end both begin again.
    page.run("hear(videos[0].duration > videos[1].duration ? 0 : 1)")
    page.run("window.ends = 0; videos[heard].addEventListener('ended', () => { ends += 1; })")
    page.press(" ")
    page.until("ends > 0 && videos.every((video) => !video.paused && video.currentTime < 0.8)")


def test_a_second_person_has_answers_of_her_own(page: Page) -> None:
    begin(page)
    page.press("1")
    page.click("#other")
    page.until("find('rate').hidden && document.activeElement.id === 'person'")
    begin(page, "B12")  # digits in a name answer nothing
    assert page.run("Object.keys(answers()).length") == 0
    page.press("0")
    assert page.run("Object.values(kept.of).map((one) => Object.values(one))") == [
        ["first"],
        ["same"],
    ]


def test_a_click_leaves_the_space_bar_to_the_videos(page: Page) -> None:
    begin(page)
    page.click("[data-answer=first]")
    page.until("videos.every((video) => !video.paused)")
    page.press(" ")
    page.until("videos.every((video) => video.paused)")
    assert page.run("Object.keys(answers()).length") == 1


def test_where_videos_are_missing_the_page_says_so(
    chromium: Browser, rated: tuple[Path, Key], tmp_path: Path
) -> None:
    shutil.copy(rated[0] / PAGE, tmp_path)
    page = chromium.open((tmp_path / PAGE).as_uri())
    page.until("document.activeElement.id === 'person'")
    page.run("begin('Ann')")
    page.until("!find('lost').hidden")


@pytest.mark.parametrize("width", [390, 1440])
def test_nothing_is_wider_than_the_window(
    chromium: Browser, rated: tuple[Path, Key], width: int
) -> None:
    page = chromium.open((rated[0] / PAGE).as_uri(), width=width, height=844, dark=width == 390)
    page.until("document.activeElement.id === 'person'")
    page.run("begin('Ann')")
    page.until("videos.every((video) => video.readyState > 2)")
    assert page.run("[document.documentElement.scrollWidth, innerWidth]") == [width, width]
    # The answers are seen without scrolling.
    assert page.run("find('answers').getBoundingClientRect().bottom < innerHeight")
    assert json.loads(page.run("find('data').textContent"))["pairs"]
