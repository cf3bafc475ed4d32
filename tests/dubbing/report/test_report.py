"""What a page holds: counts, data that any machine may see, and that it is one file."""

from __future__ import annotations

import json
import math
import os
import re
from pathlib import Path
from typing import Any

import cv2
import pytest

from dubbing import media
from dubbing.report.page import VERDICTS, page_of
from dubbing.report.report import verdict_of
from dubbing.report.sources import is_played, proxy_of
from dubbing.report.thumbnails import WIDTH, thumbnail_of
from tests import clips
from tests.dubbing.report.pages import MIXED, found, line


def data_of(page: str) -> dict[str, Any]:
    """What the page's script reads."""
    (text,) = re.findall('<script type="application/json" id="data">(.*?)</script>', page, re.S)
    return dict(json.loads(text))


def test_the_first_line_counts() -> None:
    page = page_of(found(*MIXED))
    assert "<h1>6 dubs: 2 in sync, 1 to look at, 2 failed, 1 not judged</h1>" in page
    assert "<h1>0 dubs</h1>" in page_of(found())


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


def test_what_is_shown_of_a_film(tmp_path: Path) -> None:
    plain = clips.write_clip(tmp_path / "a.mp4", 5)
    prores = tmp_path / "a.mov"
    clips.ffmpeg("-i", plain, "-c:v", "prores_ks", "-an", prores)
    deep = tmp_path / "deep.mp4"
    clips.ffmpeg("-i", plain, "-an", "-pix_fmt", "yuv420p10le", "-c:v", "libx264", deep)
    matroska = tmp_path / "a.mkv"
    clips.ffmpeg("-i", plain, "-c", "copy", matroska)
    camera, silent = tmp_path / "camera.mov", tmp_path / "silent.mov"
    clips.ffmpeg("-i", plain, "-c:v", "copy", "-c:a", "pcm_s16le", camera)
    clips.ffmpeg("-i", plain, "-c", "copy", "-an", silent)
    (tmp_path / "junk.mp4").write_bytes(b"junk")
    assert is_played(plain)
    assert is_played(silent)
    films = prores, deep, matroska, camera
    assert not any(is_played(film) for film in (*films, tmp_path / "junk.mp4"))
    work = tmp_path / "work"
    copies = [proxy_of(film, work) for film in films]
    for copy in copies:
        assert copy is not None
        assert is_played(copy)
        seen = media.read_frames(copy)
        assert [clips.number(frame) for frame in seen] == list(range(5))
    assert proxy_of(prores, work) == copies[0]
    assert len(list((work / "sources").iterdir())) == 4
    assert proxy_of(tmp_path / "junk.mp4", work) is None


def test_a_page_names_no_folder_of_its_machine() -> None:
    data = found(*MIXED)
    lost = {"where": "/home/ann/films/a.mp4", "trace": 'File "/usr/lib/x.py", line 3; 1/2, ../a/b'}
    data["dubs"]["gone"]["failure"] |= lost
    data["identities"]["ann"]["warnings"] = ["b.mp4: bad; see https://a.example/b/c"]
    read = data_of(page_of(data))
    assert read["dubs"]["gone"]["failure"]["where"] == "a.mp4"
    assert read["dubs"]["gone"]["failure"]["trace"] == 'File "x.py", line 3; 1/2, ../a/b'
    assert read["identities"]["ann"]["warnings"] == data["identities"]["ann"]["warnings"]
    assert read["dubs"]["fine"]["source"] == "../clips/ann.mp4"
    assert read["identities"]["ann"]["clip"] == "ann.mp4"


def test_words_end_no_script_and_turn_no_text_round() -> None:
    data = found(("one", "pass", 0.3))
    data["dubs"]["one"]["lines"] = [line(1, "pass") | {"words": "</script><b>\u202e"}]
    data["identities"]["ann"]["loss"] = [math.inf, 1.0, math.nan]
    page = page_of(data)
    assert page.count("</script>") == 3
    read = data_of(page)
    assert read["dubs"]["one"]["lines"][0]["words"] == "</script><b>\\u202e"
    assert read["identities"]["ann"]["loss"] == [None, 1.0, None]


def test_the_page_is_one_file_without_network() -> None:
    page = page_of(found(*MIXED))
    assert not re.search(r"<link|<script src|@import|url\(", page)
    assert '<meta name="viewport"' in page


def test_two_hundred_dubs_stay_a_small_page() -> None:
    data = found(*((f"shot{k}", "pass", 0.2) for k in range(200)))
    for dub in data["dubs"].values():
        dub["lines"] = [line(k, "pass") for k in range(5)]
    assert len(page_of(data)) < 900_000


def test_a_thumbnail_is_made_again_after_its_video(tmp_path: Path) -> None:
    video = clips.write_clip(tmp_path / "a.mp4", 5)
    path = thumbnail_of(video, 3, tmp_path / "work")
    assert path is not None
    first = path.read_bytes()
    image = cv2.imread(str(path))
    assert image is not None
    assert image.shape[1] == WIDTH
    clips.write_clip(video, 8)
    made = path.stat().st_mtime
    for later, same in ((-60, True), (60, False)):
        os.utime(video, (made + later,) * 2)
        assert thumbnail_of(video, 6, tmp_path / "work") == path
        assert (path.read_bytes() == first) is same
    (tmp_path / "junk.mp4").write_bytes(b"junk")
    assert thumbnail_of(tmp_path / "junk.mp4", 0, tmp_path / "work") is None
    assert thumbnail_of(video, 99, tmp_path / "late") is not None


def test_a_verdict_is_one_word_which_the_page_uses_as_its_class() -> None:
    assert all(verdict.isalpha() for verdict in VERDICTS)
