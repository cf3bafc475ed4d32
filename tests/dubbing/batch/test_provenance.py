"""What a dub carries when it goes out: the invisible mark, and credentials signed last."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing import media
from dubbing.batch import jobs
from dubbing.engine.disk.files import digest_file
from dubbing.engine.planning import estimates, planner
from dubbing.manifest.manifest import load
from dubbing.provenance import credentials
from tests import clips, fakes
from tests.dubbing.batches import dub as run
from tests.dubbing.provenance.chain import write_chain

pytestmark = pytest.mark.medium


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    fakes.install(monkeypatch.setattr)
    clips.write_clip(tmp_path / "ann.mp4", 30)
    clips.write_sound(tmp_path / "it.wav", 1.2)  # all of the film is spoken
    return tmp_path


def dub(place: Path, extra: str = "") -> tuple[Path, list[str], dict[str, Any]]:
    """The finished video, which stages ran, and what the report says of the dub."""
    path = place / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        '  ann: {clip: ann.mp4, seconds: 1, consent: {by: "Ann Smith", reference: "form 17"}}\n'
        f"dubs:\n  - {{identity: ann, audio: it.wav{extra}}}\n"
    )
    result, began = run(path)
    assert result.code == 0
    found = json.loads((place / "out" / "report.json").read_text())["dubs"]["ann_it"]
    return place / "out" / "ann_it.mp4", [one.partition(":")[2] for one in began], found


def test_a_signed_dub_is_signed_last_and_once(place: Path) -> None:
    pytest.importorskip("c2pa")
    write_chain(place)
    extra = ", certificate: signer.pem, key: signer.key"
    video, began, report = dub(place, extra)
    assert began[-1] == "sign"
    made = credentials.read(video)
    assert made is not None
    assert made.state == "Valid"
    model = place / "out/work/identities/ann/finetune/model.safetensors"
    assert made.dub["consent"] == [{"reference": "form 17"}]
    assert "Ann Smith" not in json.dumps(made.dub)  # a name is not for everybody
    assert made.dub["models"] == [digest_file(model)]
    assert made.dub["audio"] == [digest_file(place / "it.wav")]
    assert made.dub["mark"] == report["mark"]
    assert report["signed"]
    before = video.read_bytes()
    assert dub(place, extra)[1] == []
    assert video.read_bytes() == before
    planned = jobs.build(load(place / "m.yaml"))
    needed = estimates.estimate(planned, planner.rows(planned, force=("sign",)), {})
    assert 0 < needed.seconds < 60


def test_every_dub_is_marked_but_where_it_is_turned_off(place: Path) -> None:
    video, _, report = dub(place)
    assert len(report["mark"]) == 16
    assert not report["signed"]
    marked = list(media.read_frames(video))
    assert dub(place)[1] == []
    video, began, report = dub(place, ", mark: false")
    assert began == ["composite", "check"]
    assert report["mark"] is None
    plain = list(media.read_frames(video))
    changed = [(one != other).any() for one, other in zip(marked, plain, strict=True)]
    assert np.mean(changed) > 0.8  # a head of 10 px can miss a pattern of one level
    (place / "own.key").write_bytes(bytes(range(32)))
    video, began, report = dub(place, ", mark: {key: own.key}")
    assert began == ["composite", "check"]
    own = next(iter(media.read_frames(video)))
    assert not np.array_equal(own, marked[0])
