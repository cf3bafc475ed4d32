"""A report that is mailed: the archive holds all that its page shows."""

import json
import zipfile
from pathlib import Path

import pytest

from dubbing.errors import ExplainedError
from dubbing.manifest.manifest import load
from dubbing.report.share import pack
from tests import clips
from tests.dubbing.report.pages import found
from tests.dubbing.report.test_report import data_of
from tests.dubbing.studio.stand_in import write_scene


def test_an_archive_holds_all_that_its_page_shows(tmp_path: Path) -> None:
    production = load(write_scene(tmp_path))
    out = tmp_path / "mail.zip"
    with pytest.raises(ExplainedError, match="there is no report yet"):
        pack(production, out)
    assert not out.exists()
    data = found(("fine", "pass", 0.3), ("gone", "pass", 0.2))
    clips.write_clip(production.output.parent / "film.mp4", 10)
    production.output.mkdir(exist_ok=True)
    video = clips.write_clip(production.output / "fine.mp4", 5)
    (production.output / "fine.jpg").write_bytes(b"image")
    data["dubs"]["fine"] |= {"source": "../film.mp4", "thumbnail": "fine.jpg"}
    (production.output / "report.json").write_text(json.dumps(data))
    assert pack(production, out) == ["gone"]
    with zipfile.ZipFile(out) as archive:
        names = set(archive.namelist())
        read = data_of(archive.read("report.html").decode())
        assert archive.read("videos/fine.mp4") == video.read_bytes()
    shown = read["dubs"]["fine"]
    assert names == {"report.html", *(shown[key] for key in ("video", "source", "thumbnail"))}
    assert shown["source"].startswith("videos/source_")
    assert read["dubs"]["gone"]["video"] is None
    assert str(tmp_path) not in json.dumps(read)
