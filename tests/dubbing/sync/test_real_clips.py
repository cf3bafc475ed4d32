"""The check on real speakers, whose clips lie beside the repository, if at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubbing.sync.check import check
from dubbing.sync.judgement import MOVING_SPREAD
from dubbing.sync.result import SyncResult
from tests import clips, needs

pytestmark = pytest.mark.slow
LATE = 5  # frames


@pytest.fixture(scope="module")
def own() -> SyncResult:
    """A speaker with their own sound, whom the network did not learn from."""
    return check(needs.shared("clips/menendez.mp4"))


def test_a_speaker_follows_their_own_sound(own: SyncResult) -> None:
    assert own.verdict == "pass", own.reason
    assert abs(own.offset_frames or 0) <= 1
    assert own.faces[0].figures is not None
    assert own.faces[0].figures.spread > MOVING_SPREAD


def test_sound_moved_by_frames_is_found_that_much_later(own: SyncResult, tmp_path: Path) -> None:
    source, moved = needs.shared("clips/menendez.mp4"), tmp_path / "moved.mp4"
    later = ("-itsoffset", f"{LATE / 25}", "-i", source)
    clips.ffmpeg("-i", source, *later, "-map", "0:v", "-map", "1:a", "-c:v", "copy", moved)
    found = check(moved)
    assert own.offset_frames is not None
    assert found.offset_frames == own.offset_frames - LATE
    assert found.verdict == "fail"


def test_their_words_of_another_moment_do_not_pass(own: SyncResult, tmp_path: Path) -> None:
    source, mixed = needs.shared("clips/menendez.mp4"), tmp_path / "mixed.mp4"
    halves = (
        "[0:a]asplit[x][y];[x]atrim=4,asetpts=N/SR/TB[b];[y]atrim=0:4[a];[b][a]concat=v=0:a=1[s]"
    )
    clips.ffmpeg("-i", source, "-filter_complex", halves, "-map", "0:v", "-map", "[s]", mixed)
    found = check(mixed, source=own)
    assert found.verdict == "fail"
    assert (found.confidence or 0) < 0.6 * (own.confidence or 0)
    assert (found.closeness or 0) < 0.6


def test_their_own_words_are_the_original(own: SyncResult) -> None:
    again = check(needs.shared("clips/menendez.mp4"), source=own)
    assert again.verdict == "pass"
    assert (again.closeness or 0) > 0.95
