"""What a dubbing team waits for: what is made at each step, not how long it takes."""

import subprocess
import sys
from pathlib import Path

import pytest

from dubbing.workshop.bench import dub_times
from tests import clips

pytestmark = pytest.mark.medium


def test_each_change_makes_what_it_must(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = clips.write_clip(tmp_path / "clip.mp4", 60)
    speech = clips.write_sound(tmp_path / "it.wav", 3.0)
    real = subprocess.run

    def with_stand_ins(call: list[str], **options: object) -> object:
        return real([sys.executable, "-m", "tests.fakes", *call[3:]], **options)  # type: ignore[call-overload]

    monkeypatch.setattr(subprocess, "run", with_stand_ins)
    found = dub_times.waits(clip, speech, tmp_path / "out", 1.0, 192)
    dub = {"listen", "render", "composite", "check"}
    person = {"prepare", "check_source", "finetune", "refine_poses"}
    # (The stand-in heads do not depend on edits.)
    assert [set(one.stages) for one in found] == [
        person | dub,
        {"draft"},
        dub,
        {"render"},
        {"draft"},
        {"render"},
    ]
    assert all(one.seconds > 0 for one in found)
    rows = dub_times.table(found).splitlines()
    assert len(rows) == 8
    assert rows[3].startswith("| a draft of it | ")
