"""The page of a run: what comes first, what loads when, and that it is one file."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from dubbing import media
from dubbing.report.page import VERDICTS, page_of
from dubbing.report.report import verdict_of
from dubbing.report.sources import is_played, proxy_of
from tests import clips
from tests.dubbing.report.pages import MIXED, found, line


class Tags(HTMLParser):
    """Every start tag of a page with its attributes and the tags that it lies in."""

    EMPTY = ("meta", "br", "img", "input", "polyline")

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: list[tuple[str, dict[str, str | None], tuple[str, ...]]] = []
        self.feed(page)
        assert self.open == []  # every tag is closed

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs), tuple(self.open)))
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs), tuple(self.open)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def of(self, name: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes, _ in self.found if tag == name]


def test_the_first_line_counts_and_the_worst_come_first() -> None:
    page = page_of(found(*MIXED))
    assert "<h1>6 dubs: 2 passed, 1 warned, 2 failed, 1 unjudged</h1>" in page
    assert page.index("<h1>") == page.index("<body>") + len("<body>\n")
    shown = [a["id"] for a in Tags(page).of("article") if a.get("class") == "dub"]
    names = [str(identifier).removeprefix("dub-") for identifier in shown]
    assert names == ["still", "gone", "early", "quiet", "weak", "fine"]


@pytest.mark.parametrize(
    ("state", "sync", "verdict"),
    [
        ("made", "pass", "passed"),
        ("kept", "warn", "warned"),
        ("made", "fail", "failed"),
        ("failed", "pass", "failed"),
        ("skipped", "", "failed"),
        ("stopped", "pass", "missing"),
        ("not in this run", "", "missing"),
        ("not in this run", "pass", "passed"),
        ("made", "unjudged", "unjudged"),
    ],
)
def test_what_a_dub_comes_to(state: str, sync: str, verdict: str) -> None:
    assert verdict_of(state, {"verdict": sync} if sync else {}) == verdict


def test_every_dub_can_be_sorted_and_filtered() -> None:
    tags = Tags(page_of(found(*MIXED)))
    cards = [a for a in tags.of("article") if a.get("class") == "dub"]
    assert [card["data-worst"] for card in cards] == ["1", "2", "3", "4", "5", "6"]
    assert sorted(str(card["data-place"]) for card in cards) == ["0", "1", "2", "3", "4", "5"]
    boxes = {a["value"] for a in tags.of("input") if a.get("name") == "verdict"}
    assert boxes == {card["data-verdict"] for card in cards}
    assert {a["value"] for a in tags.of("option")} == {"worst", "name", "place"}


def test_videos_load_when_seen_source_beside_dub() -> None:
    tags = Tags(page_of(found(*MIXED)))
    videos = tags.of("video")
    assert len(videos) == 2 * len(MIXED)
    assert all(video["preload"] == "none" and "autoplay" not in video for video in videos)
    source, result = videos[:2]
    assert (source["src"], source["data-start"]) == ("../clips/ann.mp4", "1.5")
    assert "muted" in source
    assert result["src"] == "still.mp4"
    assert all(image["loading"] == "lazy" for image in tags.of("img"))


def test_without_the_film_the_dub_stands_alone() -> None:
    data = found(("fine", "pass", 0.3))
    data["dubs"]["fine"]["source"] = None
    assert [v["src"] for v in Tags(page_of(data)).of("video")] == ["fine.mp4"]


def test_the_sync_is_said_once_and_for_a_director() -> None:
    page = page_of(found(("weak", "fail", 0.1)))
    assert "<p>measured weak</p>" in page
    assert "in sync" not in page
    assert "as in the film: timing 96 %, sharpness 50 %" in " ".join(page.split())


def test_what_is_shown_of_a_film(tmp_path: Path) -> None:
    plain = clips.write_clip(tmp_path / "a.mp4", 5)
    prores = tmp_path / "a.mov"
    clips.ffmpeg("-i", plain, "-c:v", "prores_ks", "-an", prores)
    deep = tmp_path / "deep.mp4"
    clips.ffmpeg("-i", plain, "-an", "-pix_fmt", "yuv420p10le", "-c:v", "libx264", deep)
    matroska = tmp_path / "a.mkv"
    clips.ffmpeg("-i", plain, "-c", "copy", matroska)
    (tmp_path / "junk.mp4").write_bytes(b"junk")
    played = [is_played(f) for f in (plain, prores, deep, matroska, tmp_path / "junk.mp4")]
    assert played == [True, False, False, False, False]
    work = tmp_path / "work"
    copies = [proxy_of(film, work) for film in (prores, deep, matroska)]
    for copy in copies:
        assert copy is not None
        assert is_played(copy)
        seen = media.read_frames(copy)
        assert [clips.number(frame) for frame in seen] == list(range(5))
    assert proxy_of(prores, work) == copies[0]
    assert len(list((work / "sources").iterdir())) == 3
    assert proxy_of(tmp_path / "junk.mp4", work) is None


def test_lines_that_nobody_dubs_are_listed() -> None:
    data = found(("scene", "pass", 0.3))
    left = {"line": 7, "in": "01:00:00:00", "speaker": "BOB", "words": "a <b>", "why": "not known"}
    data["dubs"]["scene"]["undubbed"] = [left]
    page = page_of(data)
    assert "1 line of the script that nobody dubs" in " ".join(page.split())
    assert "<b>BOB</b> a &lt;b&gt;" in page


def test_without_its_videos_the_page_says_so() -> None:
    tags = Tags(page_of(found(("fine", "pass", 0.3))))
    (lost,) = [a for a in tags.of("p") if a.get("class") == "lost note"]
    assert "hidden" in lost


def test_a_card_is_small_and_its_details_closed() -> None:
    tags = Tags(page_of(found(*MIXED)))
    for tag, _, around in tags.found:
        if tag in ("table", "svg", "pre", "img"):
            assert "details" in around
    assert all("open" not in attributes for attributes in tags.of("details"))


def test_the_page_is_one_file_without_network() -> None:
    page = page_of(found(*MIXED))
    assert not re.search(r"https?:|//\w+\.\w+|@import|url\(", page)
    tags = Tags(page)
    assert tags.of("link") == []
    assert all("src" not in script for script in tags.of("script"))
    assert [m["content"] for m in tags.of("meta") if m.get("name") == "viewport"]


def test_two_hundred_dubs_stay_a_small_page() -> None:
    page = page_of(found(*((f"shot{k}", "pass", 0.2) for k in range(200))))
    assert len(page) < 600_000
    assert len(Tags(page).of("article")) == 201


def test_the_lines_of_a_scene_are_listed_where_one_asks_for_them() -> None:
    data = found(("scene", "pass", 0.3))
    proof = {"frames": 30, "of": 90, "source": "ab" * 32, "result": "ab" * 32, "identical": True}
    data["dubs"]["scene"] |= {
        "lines": [line(1, "pass"), line(2, None) | {"edit": "strength 0.5: <b>"}],
        "line_counts": {"pass": 1, "unjudged": 1},
        "short_lines": 1,
        "untouched": {**proof, "psnr": None},
    }
    page = page_of(data)
    tags = Tags(page)
    buttons = [(a, around) for tag, a, around in tags.found if tag == "button"]
    assert [a["data-at"] for a, _ in buttons] == ["1.5", "1.5"]
    assert all("details" in around for _, around in buttons)
    assert "2 lines" in page
    assert "a &lt;b&gt;" in page
    assert page.count("the film's own face in frames: covered 40-44") == 1
    assert page.count("lies over the mouth and stays there, in frames: 45-60") == 1
    part = '<span class="tag warn">dubbed in part</span>'
    assert page.count(part) == 2  # above the table, and beside the line
    assert f"{part}\n80 % of the frames dubbed" in page
    assert "<br>all frames dubbed" in page
    assert page.count('<span class="tag">edited</span> strength 0.5: &lt;b&gt;') == 1
    assert "30 of 90 frames are" in page
    assert "SHA-256\nabababababababab" in page


def test_how_much_is_dubbed_stands_below_a_dub_of_one_recording() -> None:
    data = found(("one", "pass", 0.3))
    data["dubs"]["one"]["lines"] = [line(1, "pass") | {"words": "", "edit": "strength 0.5"}]
    page = page_of(data)
    assert '<p class="note"><span class="tag">edited</span> strength 0.5</p>' in page
    assert '<p class="note"><span class="tag warn">dubbed in part</span>\n80 % of the' in page


def test_forty_scenes_of_five_lines_stay_a_small_page() -> None:
    data = found(*((f"shot{k}", "pass", 0.2) for k in range(40)))
    for dub in data["dubs"].values():
        dub["lines"] = [line(k, "pass") for k in range(5)]
        dub["line_counts"] = {"pass": 5}
    assert len(page_of(data)) < 300_000


def test_an_empty_run_has_a_page() -> None:
    page = page_of(found())
    assert "<h1>0 dubs: 0 passed, 0 warned, 0 failed</h1>" in page
    assert "The manifest has no dubs." in page


def test_a_verdict_is_one_word_which_the_page_uses_as_its_class() -> None:
    assert all(verdict.isalpha() for verdict in VERDICTS)


def test_a_dub_without_mark_or_credentials_is_reported() -> None:
    page = page_of(found(("one", "pass", 0.2), ("two", "pass", 0.1)))
    assert "invisible mark 0123456789abcdef" in page
    assert page.count("without the invisible mark") == 1
    assert page.count("without signed credentials") == 1
    assert page.count("without the visible mark") == 1
    assert page.count("not found again in this video") == 1
    assert page.count("the film's own face in frames: turned 3-9") == 2
    assert page.count("frames to look at: something lies over it 20-31") == 2
    data = found(("one", "pass", 0.2))
    data["dubs"]["one"]["film_credentials"] = "its credentials do not hold: hash"
    assert "of the film it was made of, its credentials do not hold: hash" in page_of(data)


def test_a_person_is_shown_with_what_they_agreed_to() -> None:
    page = " ".join(page_of(found(("one", "pass", 0.2))).split())
    assert "languages: it; until further notice; films: any" in page
    assert '<p class="note">learned from 3.0-6.0 s, 21.0-33.0 s</p>' in page
