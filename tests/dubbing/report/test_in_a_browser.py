"""The page in headless Chromium: what a director sees, clicks, types and plays."""

from __future__ import annotations

import html
import json
import re
import subprocess
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

from tests import needs
from tests.dubbing.report.pages import DUBS, SOURCE, write_everything

pytestmark = pytest.mark.medium
WORST_FIRST = ["still", "gone", "shot10", "early", "quiet", "weak", "fine", "shot9"]
VERDICTS = {"failed": WORST_FIRST[:2], "warned": WORST_FIRST[2:4], "unjudged": ["quiet"]}
VERDICTS["passed"] = WORST_FIRST[5:]
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--hide-scrollbars"),
    *("--allow-file-access-from-files", "--autoplay-policy=no-user-gesture-required", "--dump-dom"),
)
# Stands before all else in the page: files alone may be asked for, and what fails is noted.
WATCH = """<meta http-equiv="Content-Security-Policy" content="default-src file: 'unsafe-inline'">
<script>const found = { errors: [], blocked: [], without: {}, played: [] };
addEventListener("error", (event) => found.errors.push(event.message));
addEventListener("securitypolicyviolation", (event) => found.blocked.push(event.blockedURI));
</script>"""
# Chromium prints a page once it is loaded. An open document in a frame holds that back.
ACTIONS = """<iframe id="hold" hidden></iframe><pre id="findings" hidden></pre><script>
const hold = document.getElementById("hold").contentDocument.open();
(async () => {
const find = (query) => [...document.querySelectorAll(query)];
const part = (name, query) => find(`#dub-${name} ${query}`);
const frame = () => new Promise((go) => requestAnimationFrame(() => setTimeout(go, 50)));
const wait = async (until, most = 400) => { while (most-- && !until()) await frame(); };
const box = (tag) => tag.getBoundingClientRect();
const shown = () => find(".dub").filter((card) => card.checkVisibility())
  .sort((a, b) => box(a).top - box(b).top).map((card) => card.dataset.name);
const send = (tag, value, ...events) => {
  tag.value = value;
  for (const event of events) tag.dispatchEvent(new Event(event, { bubbles: true }));
  return shown();
};
const videos = () => find("video").map((video) => [video.readyState > 0,
  box(video).bottom > -200 && box(video).top < innerHeight + 200, video.preload]);
const settled = async (tag) => {
  tag.scrollIntoView();
  await wait(() => false, 4);
  await wait(() => videos().every(([ready, near]) => ready === near));
  await wait(() => false, 4);
  return videos();
};
const share = (tag) => Math.round(10 * tag.offsetWidth / tag.parentElement.offsetWidth);
const press = (key, from = document.body, more = {}) => {
  from.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, ...more }));
  return ["still", "early"].map((name) => part(name, "figure").map(share));
};
found.links = find("[href], [src]:not(#hold), [data-src]").map((tag) => [tag.closest("[id]")?.id,
  tag.className, tag.href || tag.src, !tag.hash || !!document.getElementById(tag.hash.slice(1))]);
found.styles = [...document.styleSheets].flatMap((s) => [...s.cssRules]).map((r) => r.cssText);
found.at_first = videos(), found.all = shown();
const { name, sort, verdict } = document.getElementById("tools").elements;
for (const tick of verdict) { tick.click(); found.without[tick.value] = shown(); tick.click(); }
found.named = ["EA", "bob", "nobody", ""].map((words) => send(name, words, "input"));
found.sorted = ["name", "place", "worst"].map((by) => send(sort, by, "input", "change"));
found.keys = ["a", "x", "B", "Escape"].map((key) => press(key));
part("early", ".note")[0].dispatchEvent(new Event("pointerdown", { bubbles: true }));
found.keys_there = [press("a"), press("b", name), press("b", document.body, { ctrlKey: true })];
found.keys_there.push(press("Escape"));
const [source, result] = part("still", "video"), [other] = part("shot9", ".result");
found.seen = [await settled(result), await settled(other), await settled(result)];
found.seconds = [source.duration, result.duration, source.currentTime];
scrollTo(0, document.body.scrollHeight);
part("still", "[data-at]")[1].click();
found.in_sight = box(result).top >= 0 && box(result).bottom <= innerHeight;
await wait(() => result.currentTime && Math.abs(source.currentTime - 2) < 0.01);
found.at = [source.currentTime, result.currentTime];
for (const video of [result, other]) {
  video.scrollIntoView();
  await wait(() => video.readyState);
  video.play().catch((error) => found.errors.push(String(error)));
  await wait(() => video.currentTime > 0.55 && source.currentTime > 2.01);
  found.played.push([source.currentTime > 2.01, result.paused, other.paused]);
}
send(name, "still", "input");
found.hidden_plays = !other.paused;
send(name, "", "input");
press("a");
part("early", ".source")[0].dispatchEvent(new Event("error"));
found.without_source = ["a", "Escape"].map((key) => press(key)[1]);
})().catch((error) => found.errors.push(String(error))).finally(() => {
  document.getElementById("findings").textContent = JSON.stringify(found);
  hold.close();
});</script>"""
# A window cannot be as narrow as a phone: a frame can. Measured with all details closed, then open.
PHONE = """<pre id="findings"></pre><script>function measure(page) {
  const root = page.documentElement, widths = [root.clientWidth, root.scrollWidth];
  for (const part of page.querySelectorAll("details")) part.open = true;
  document.getElementById("findings").textContent =
    JSON.stringify({ widths: [...widths, root.scrollWidth] });
}</script><iframe src="report.html" width="390" onload="measure(contentDocument)"></iframe>"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_everything(tmp_path_factory.mktemp("browser"))


def findings(page: Path, size: str) -> dict[str, Any]:
    """What the script of a page writes into its element ``findings``."""
    profile = page.parent.parent / f"profile_{page.stem}"
    command = [needs.chromium(), *FLAGS, f"--user-data-dir={profile}", f"--window-size={size}"]
    shown = subprocess.run(
        [*command, page.as_uri()], capture_output=True, text=True, timeout=300, check=True
    ).stdout
    text = re.search('<pre id="findings"[^>]*>({.*?})</pre>', shown)
    assert text, shown[-2000:]
    return dict(json.loads(html.unescape(text[1])))


@pytest.fixture(scope="module")
def seen(report: Path) -> dict[str, Any]:
    """What a director finds in a window of one column, a card or two high."""
    page = report.read_text(encoding="utf-8").replace("<title>", f"{WATCH}<title>", 1)
    watched = report.with_name("watched.html")
    watched.write_text(page.replace("</body>", f"{ACTIONS}</body>"), encoding="utf-8")
    return findings(watched, "700,600")


def test_the_cards_are_there_the_worst_first(seen: dict[str, Any]) -> None:
    assert seen["all"] == WORST_FIRST
    assert seen["errors"] == []


def test_a_verdict_without_its_tick_is_hidden_and_no_other(seen: dict[str, Any]) -> None:
    assert seen["without"] == {
        verdict: [name for name in WORST_FIRST if name not in hidden]
        for verdict, hidden in VERDICTS.items()
    }


def test_a_dub_is_found_by_its_name_or_its_person(seen: dict[str, Any]) -> None:
    assert seen["named"] == [["early", "weak"], ["quiet"], [], WORST_FIRST]


def test_dubs_are_sorted_again(seen: dict[str, Any]) -> None:
    by_name = ["early", "fine", "gone", "quiet", "shot9", "shot10", "still", "weak"]
    assert seen["sorted"] == [by_name, [name for name, _, _ in DUBS], WORST_FIRST]


def test_keys_show_the_source_the_dub_or_both(seen: dict[str, Any]) -> None:
    """In the card that was touched last. Tenths of its width: of the source, of the dub."""
    both, source, dub = [5, 5], [10, 0], [0, 10]
    assert seen["keys"] == [[source, both], [source, both], [dub, both], [both, both]]
    # Neither a letter of a name nor a shortcut of the browser is meant.
    assert seen["keys_there"] == [[both, source], [both, source], [both, source], [both, both]]


def test_every_link_leads_somewhere(seen: dict[str, Any]) -> None:
    """To a file, and in the page to a part of it."""
    paths = [(c, kind, Path(unquote(urlsplit(url).path))) for c, kind, url, _ in seen["links"]]
    assert [path for _, _, path in paths if not path.is_file()] == []
    assert [url for _, _, url, there in seen["links"] if not there] == []
    ends = {(card, kind): path.name for card, kind, path in paths if kind}
    with_videos = [name for name in WORST_FIRST if name != "gone"]
    dubs = {(f"dub-{name}", "result"): f"{name}.mp4" for name in with_videos}
    assert ends == dubs | {(f"dub-{name}", "source"): Path(SOURCE).name for name in with_videos}


def test_the_page_asks_for_files_alone(seen: dict[str, Any]) -> None:
    assert {urlsplit(url).scheme for _, _, url, _ in seen["links"]} == {"file"}
    assert not [rule for rule in seen["styles"] if "url(" in rule or "@import" in rule]
    assert len(seen["styles"]) > 20
    assert seen["blocked"] == []


def test_a_video_is_loaded_while_it_is_near_and_let_go_after(seen: dict[str, Any]) -> None:
    far = {(ready, preload) for ready, near, preload in seen["at_first"] if not near}
    assert far == {(False, "none")}
    loaded = [[ready for ready, _, _ in place] for place in seen["seen"]]
    assert loaded == [[near for _, near, _ in place] for place in seen["seen"]]
    first, last, _ = loaded
    assert first[:2] == last[-2:] == [True, True]
    assert first[-2:] == last[:2] == [False, False]


def test_a_dub_and_its_source_play_together_from_a_line(seen: dict[str, Any]) -> None:
    """The source begins at 1.5 s with the dub, the line at 0.5 s of it."""
    assert seen["seconds"] == pytest.approx([12.0, 10.0, 1.5], abs=0.1)
    assert seen["at"] == pytest.approx([2.0, 0.5], abs=0.02)
    # Whether the source went on, the dub rests, another dub rests, as each is started.
    assert seen["played"] == [[True, False, True], [True, True, False]]


def test_a_line_brings_its_video_into_sight(seen: dict[str, Any]) -> None:
    assert seen["in_sight"] is True


def test_a_dub_that_is_filtered_out_falls_silent(seen: dict[str, Any]) -> None:
    assert seen["hidden_plays"] is False


def test_where_the_source_cannot_be_played_the_dub_stays(seen: dict[str, Any]) -> None:
    key_a, escape = seen["without_source"]
    assert key_a == escape
    assert key_a[-1] > 0


def test_nothing_is_wider_than_a_phone(report: Path) -> None:
    phone = report.with_name("phone.html")
    phone.write_text(PHONE, encoding="utf-8")
    assert findings(phone, "700,900")["widths"] == [390, 390, 390]
