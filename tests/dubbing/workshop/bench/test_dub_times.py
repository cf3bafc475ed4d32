"""What a dubbing team waits for: what is made at each step, not how long it takes."""

import subprocess
from pathlib import Path
from typing import Any

import pytest

from dubbing.workshop.bench import dub_times
from tests import clips
from tests.attack import rule

pytestmark = pytest.mark.medium


def test_each_change_makes_what_it_must(
    tmp_path: Path, stand_ins: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = clips.write_clip(tmp_path / "clip.mp4", 60)
    speech = clips.write_sound(tmp_path / "it.wav", 3.0)
    real = subprocess.run

    def in_this_process(call: list[str], **options: Any) -> object:
        if call[1:3] != ["-m", "dubbing"]:
            return real(call, **options)
        assert rule.call(*call[3:]).code == 0
        return None

    monkeypatch.setattr(subprocess, "run", in_this_process)
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
