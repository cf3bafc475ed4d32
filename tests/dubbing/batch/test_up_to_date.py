"""What a second run of a batch makes again, and why."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubbing.batch.jobs import build
from dubbing.engine.planning import planner as planning
from dubbing.manifest.manifest import load
from tests.dubbing.batches import dub, manifest_of

pytestmark = [pytest.mark.medium, pytest.mark.usefixtures("stand_ins")]


def test_a_second_run_has_nothing_to_do(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    before = (tmp_path / "out" / "ann_it.mp4").stat().st_mtime_ns
    result, began = dub(path)
    assert (result.code, began) == (0, [])
    assert result.outcomes["dub/ann_it"].state == "kept"
    assert (tmp_path / "out" / "ann_it.mp4").stat().st_mtime_ns == before


def test_only_what_depends_on_a_change_is_made_again(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    path.write_text(path.read_text().replace("it.wav}", "it.wav, label: false}"))
    _, began = dub(path)
    assert began == ["ann_it:composite", "ann_it:check"]
    path.write_text(path.read_text().replace("seconds: 1,", "seconds: 1, seed: 3,"))
    _, began = dub(path)
    # The stand-in heads do not depend on the seed, so the video is the same, and is not checked.
    assert began == ["ann:finetune", "ann:refine_poses", "ann_it:render", "ann_it:composite"]


def test_a_folder_that_was_moved_is_up_to_date(footage: Path, tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    for name in ("ann.mp4", "it.wav"):
        (before / name).write_bytes((footage / name).read_bytes())
    path = manifest_of(before, before, {"ann": "ann.mp4"})
    dub(path)
    before.rename(after)
    moved = after / path.name
    moved.write_text(moved.read_text().replace(str(before), str(after)))
    assert dub(moved)[1] == []
    assert dub(moved, force=("render",))[1] == ["ann_it:render"]  # it reads the clip where it is


def test_a_dub_that_was_renamed_is_up_to_date(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", name: before")
    dub(path)
    path.write_text(path.read_text().replace("name: before", "name: other"))
    assert {row.state for row in planning.rows(build(load(path)))} == {"up to date"}
    assert (tmp_path / "out" / "work" / "dubs" / "before").is_dir()  # a plan moves nothing
    assert dub(path)[1] == []
    assert (tmp_path / "out" / "other.mp4").is_file()
    assert [p.name for p in (tmp_path / "out" / "work" / "dubs").iterdir()] == ["other"]


def test_a_lost_result_is_put_back(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    (tmp_path / "out" / "ann_it.mp4").unlink()
    _, began = dub(path)
    assert began == []
    assert (tmp_path / "out" / "ann_it.mp4").is_file()


def test_force(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    _, began = dub(path, force=("listen",))
    assert began == ["ann_it:listen"]  # it came out the same, so nothing follows


def test_plan_prints_what_would_run_and_why(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4", "bad": "damaged.mp4"})

    def states(force: tuple[str, ...] = ()) -> dict[str, str]:
        found = planning.rows(build(load(path)), force)
        return {
            f"{row.job.name}:{row.name.split()[0]}": f"{row.state}; {row.reasons}" for row in found
        }

    first = states()
    assert first["ann:prepare"].startswith("run; ('not made yet',)")
    assert first["bad_it:all"].startswith("blocked")
    assert not (tmp_path / "out").exists()  # it wrote nothing
    dub(path)
    assert set(states().values()) >= {"up to date; ()"}
    path.write_text(path.read_text().replace("seconds: 1,", "seconds: 1, seed: 3,", 1))
    changed = states()
    assert changed["ann:prepare"] == "up to date; ()"
    assert changed["ann:finetune"] == "run; ('seed: 0 before, 3 now',)"
    assert changed["ann_it:render"].startswith("after; ('if finetune or refine_poses gives another")
    assert changed["ann_it:composite"].startswith("after")
    assert changed["ann_it:listen"] == "up to date; ()"
    assert states(("listen",))["ann_it:listen"] == "run; ('forced',)"
