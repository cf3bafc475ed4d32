"""Which seconds a person was learned from is said where it is known."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dubbing.cli import console
from dubbing.engine.disk.files import atomic_write_json
from dubbing.engine.planning.estimates import Estimate
from dubbing.identity.learned import Learned, in_words, learned_if_known


def test_what_the_fine_tune_wrote_is_said(tmp_path: Path) -> None:
    assert learned_if_known(tmp_path) == []
    (tmp_path / "finetune.json").write_text("{}")
    assert learned_if_known(tmp_path) == []  # of another shape
    summary = {"clip": "ann.mp4", "learned": [[3.0, 6], [21.04, 33]], "beside": []}
    atomic_write_json(tmp_path / "finetune.json", summary | {"turned": [[[7.0, 7.2]]]})
    expected = [("ann.mp4", [(3.0, 6.0), (21.04, 33.0)], [(7.0, 7.2)])]
    assert learned_if_known(tmp_path) == expected
    assert in_words(expected) == "learned from 3.0-6.0 s, 21.0-33.0 s and 0.2 s of turned heads"


def test_several_clips_are_named() -> None:
    clips: Learned = [
        ("ann.mp4", [(0.0, 5.0)], []),
        ("unused.mp4", [], []),
        ("shot7.mp4", [(0.0, 4.0), (6.0, 7.0)], []),
        ("shot9.mp4", [], [(1.0, 1.1), (2.0, 2.2)]),
    ]
    assert in_words(clips) == (
        "learned from ann.mp4 0.0-5.0 s; shot7.mp4 0.0-4.0 s, 6.0-7.0 s; "
        "shot9.mp4 0.3 s of turned heads"
    )


def test_a_plan_says_it(capsys: pytest.CaptureFixture[str]) -> None:
    nothing = Estimate(0, 0, 0, 0, 0)
    learned: Learned = [("ann.mp4", [(3.0, 6.0), (21.04, 33.0)], [])]
    console.plan([], [], nothing, {"ann": learned}, as_json=False)
    assert "ann: learned from 3.0-6.0 s, 21.0-33.0 s" in capsys.readouterr().out
    console.plan([], [], nothing, {"ann": [("ann.mp4", [(3.0, 6.0)], [])]}, as_json=True)
    said = json.loads(capsys.readouterr().out)["learned"]
    assert said == {"ann": [["ann.mp4", [[3.0, 6.0]], []]]}
