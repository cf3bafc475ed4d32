from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from dubbing.engine.disk import claims
from dubbing.engine.disk.claims import Watch
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import atomic_write_text
from dubbing.engine.errors import ExplainedError, StageError
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Stage
from dubbing.engine.graph.stage_id import StageId
from dubbing.engine.running import update


def quiet(_message: str, _share: float) -> None:
    pass


@dataclass
class Work:
    """How the work of a stage goes: it can be made to fail, and counts the pieces it made."""

    fail_at: int | None = None
    made: list[str] = field(default_factory=list)
    instead: Callable[[Path], None] | None = None


@dataclass(frozen=True, kw_only=True)
class Copy(Stage):
    """Copies a text a piece at a time."""

    text: Path
    seed: int = 0
    code: Setting[str] = "1"
    work: Setting[Work]

    def run(self, out: Path, progress: Progress) -> None:
        if self.work.instead:
            self.work.instead(out)
            return
        for k, letter in enumerate(self.text.read_text()):
            if self.work.fail_at == k:
                raise ExplainedError("no more")
            piece = out / f"{k}.txt"
            if not piece.exists():
                atomic_write_text(piece, letter)
                self.work.made.append(letter)

    @classmethod
    def versions(cls) -> dict[str, str]:
        return {"copier": "1.2"}

    @property
    def version(self) -> str:
        return self.code


@dataclass(frozen=True, kw_only=True)
class CopyMore(Copy):
    """The same with one more parameter."""

    x: int


@dataclass(frozen=True, kw_only=True)
class Later(Stage):
    """Copies the first letter again."""

    letters: Copy

    def run(self, out: Path, progress: Progress) -> None:
        (out / "0.txt").write_text((self.letters.folder / "0.txt").read_text())


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "in.txt"
    path.write_text("abc")
    return path


@pytest.fixture
def work() -> Work:
    return Work()


@pytest.fixture
def stage(tmp_path: Path, source: Path, work: Work) -> Copy:
    folder = tmp_path / "work" / "letters"
    return Copy(id=StageId("job/it", "copy"), folder=folder, text=source, work=work)


@pytest.fixture
def later(tmp_path: Path, stage: Copy) -> Later:
    """A stage that reads the first."""
    folder = tmp_path / "work" / "later"
    return Later(id=StageId("job/it", "later"), folder=folder, letters=stage)


def contents(stage: Copy) -> str:
    return "".join(p.read_text() for p in sorted(stage.folder.glob("*.txt")))


def test_a_stage_is_done_once(stage: Copy, work: Work) -> None:
    assert stage.changes() == ["not made yet"]
    assert update.run_stage(stage, quiet)
    assert stage.changes() == []
    assert not update.run_stage(stage, quiet)
    assert work.made == ["a", "b", "c"]


def test_the_record_holds_how_it_was_made(stage: Copy, source: Path) -> None:
    update.run_stage(stage, quiet)
    record = json.loads((stage.folder / "stage.json").read_text())
    assert record["stage"] == "copy"
    assert record["version"] == "1"
    assert record["parameters"] == {"seed": 0}
    assert record["inputs"] == {"text": digest_of(source)}
    assert sorted(record["outputs"]) == ["0.txt", "1.txt", "2.txt"]
    assert record["versions"] == {"copier": "1.2"}
    assert record["seconds"] >= 0


def test_it_is_stale_for_a_reason_and_reports_it(stage: Copy, source: Path) -> None:
    update.run_stage(stage, quiet)
    assert replace(stage, seed=1).changes() == ["seed: 0 before, 1 now"]
    more = CopyMore(folder=stage.folder, text=source, work=stage.work, x=2)
    assert more.changes() == ["x: None before, 2 now"]
    assert replace(stage, code="2").changes() == ["the code of the stage changed"]
    source.write_text("abcd")
    assert stage.changes() == ["text changed"]
    source.write_text("abc")
    assert stage.changes() == []
    (stage.folder / "0.txt").write_text("z")
    (stage.folder / "1.txt").unlink()
    assert stage.changes() == ["0.txt was altered", "1.txt is gone"]
    update.run_stage(stage, quiet)
    assert contents(stage) == "abc"


def test_a_failed_stage_goes_on_where_it_stopped(stage: Copy, work: Work) -> None:
    work.fail_at = 2
    with pytest.raises(ExplainedError):
        update.run_stage(stage, quiet)
    assert not stage.folder.exists()
    assert stage.changes() == ["interrupted: goes on where it stopped"]
    work.fail_at = None
    update.run_stage(stage, quiet)
    assert work.made == ["a", "b", "c"]
    assert contents(stage) == "abc"


def test_other_settings_do_not_pick_up_partial_work(stage: Copy, work: Work) -> None:
    work.fail_at = 2
    with pytest.raises(ExplainedError):
        update.run_stage(stage, quiet)
    work.fail_at = None
    other = replace(stage, seed=5)
    assert other.changes() == ["not made yet"]
    update.run_stage(other, quiet)
    assert work.made == ["a", "b", "a", "b", "c"]
    # What the first settings left behind is gone, now that others are good.
    assert [p.name for p in stage.folder.parent.iterdir()] == ["letters"]


def test_the_last_good_result_survives_a_failed_rerun(stage: Copy, work: Work) -> None:
    update.run_stage(stage, quiet)
    changed = replace(stage, seed=1)
    work.fail_at = 1
    with pytest.raises(ExplainedError):
        update.run_stage(changed, quiet)
    assert contents(stage) == "abc"
    assert stage.changes() == []


def test_force_starts_from_nothing(stage: Copy, work: Work) -> None:
    update.run_stage(stage, quiet)
    assert update.run_stage(stage, quiet, force=True)
    assert work.made == list("abcabc")


def test_torn_files_of_a_killed_run_do_not_stay(stage: Copy) -> None:
    stage.partial().mkdir(parents=True)
    (stage.partial() / ".0.4711.tmp.txt").write_text("half")
    update.run_stage(stage, quiet)
    assert sorted(p.name for p in stage.folder.iterdir())[0] == "0.txt"


def test_a_swap_that_was_cut_short(stage: Copy) -> None:
    update.run_stage(stage, quiet)
    changed = replace(stage, seed=1)
    # As after: the new result sealed, the old one moved away, then a kill.
    partial = changed.partial()
    partial.mkdir()
    changed.run(partial, quiet)
    update._seal(changed, partial, key=changed.key(), digests=changed.digests(), seconds=0)
    stage.folder.rename(stage.folder.with_name("letters.old"))
    update.recover(changed)
    assert contents(stage) == "abc"  # the last good result is back ...
    assert update.run_stage(changed, quiet)  # ... and the new one goes in without being made again
    assert changed.changes() == []
    assert [p.name for p in stage.folder.parent.iterdir()] == ["letters"]


def test_an_input_that_changes_meanwhile_is_noticed(stage: Copy, source: Path) -> None:
    def change(out: Path) -> None:
        (out / "x").write_text("x")
        source.write_text("other")

    stage.work.instead = change
    with pytest.raises(ExplainedError, match=r"in\.txt changed while the run .* again"):
        update.run_stage(stage, quiet)
    assert list(stage.folder.parent.iterdir()) == []  # what was made of it is of no use


def test_an_input_that_goes_away_is_what_is_reported(stage: Copy, source: Path) -> None:
    def lose(out: Path) -> None:
        source.unlink()
        raise ExplainedError("no such file")

    stage.work.instead = lose
    with pytest.raises(ExplainedError, match=r"in\.txt changed while the run was going on"):
        update.run_stage(stage, quiet)


def test_inputs_are_what_they_were_when_the_run_began(
    stage: Copy, later: Later, source: Path
) -> None:
    """Also those of the stages before, which a later stage may read once more."""
    update.run_stage(stage, quiet)
    began = later.sources()
    assert list(began) == [source]
    source.write_text("xyz")
    with pytest.raises(ExplainedError, match=r"in\.txt changed while the run .* \(later\)"):
        update.run_stage(later, quiet, began=began)
    source.unlink()
    os.mkfifo(source)  # it is not waited for
    with pytest.raises(ExplainedError, match=r"in\.txt changed"):
        update.run_stage(later, quiet, began=began)


@pytest.mark.parametrize(
    "record",
    ["[]", "{}", "[" * 99_999, '{"outputs": []}', '{"version": 1, "outputs": {"0": 3}}', "pipe"],
)
def test_a_record_of_another_shape_is_none(stage: Copy, record: str) -> None:
    update.run_stage(stage, quiet)
    path = stage.folder / "stage.json"
    path.unlink()
    if record == "pipe":
        os.mkfifo(path)
    else:
        path.write_text(record)
    assert stage.changes() == ["its record is damaged"]
    update.run_stage(stage, quiet)
    assert stage.changes() == []


def test_a_stage_depends_on_what_another_made(stage: Copy, later: Later, source: Path) -> None:
    update.run_stage(stage, quiet)
    update.run_stage(later, quiet)
    assert later.changes() == []
    source.write_text("xyz")
    update.run_stage(stage, quiet)
    assert later.changes() == ["letters changed"]
    # Made again with the same result: nothing follows from it.
    source.write_text("abc")
    update.run_stage(stage, quiet)
    assert later.changes() == []


def test_a_damaged_file_of_an_interrupted_run_is_made_again(stage: Copy, work: Work) -> None:
    work.fail_at = 2
    with pytest.raises(ExplainedError):
        update.run_stage(stage, quiet)
    (stage.partial() / "0.txt").write_text("z")
    work.fail_at = None
    update.run_stage(stage, quiet)
    assert (contents(stage), work.made) == ("abc", ["a", "b", "a", "c"])
    assert sorted(p.name for p in stage.folder.iterdir())[0] == "0.txt"  # no digests beside them


def test_a_kill_between_a_file_and_its_digest_costs_nothing(
    stage: Copy, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that is written anew again and again, as a state: either of the two is whole."""
    file = stage.partial() / "state.txt"
    atomic_write_text(file, "one")

    def die(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", die)
    with pytest.raises(KeyboardInterrupt):
        atomic_write_text(file, "two")
    monkeypatch.undo()
    update.run_stage(stage, quiet)
    assert (stage.folder / "state.txt").read_text() == "one"


def test_damaged_finished_work_is_not_put_in_its_place(
    stage: Copy, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    def die(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(update, "_swap", die)
    with pytest.raises(KeyboardInterrupt):
        update.run_stage(stage, quiet)
    monkeypatch.undo()
    (stage.partial() / "1.txt").write_text("z")
    update.run_stage(stage, quiet)
    assert contents(stage) == "abc"


@pytest.mark.parametrize("asleep", range(3))
@pytest.mark.parametrize("before", [False, True], ids=["first", "again"])
def test_who_sleeps_at_the_swap_leaves_what_another_finished(
    stage: Copy, monkeypatch: pytest.MonkeyPatch, asleep: int, before: bool
) -> None:
    """Before any of its moves: another process takes the work over, and finishes it."""
    if before:
        update.run_stage(replace(stage, code="0"), quiet)
    moves = 0
    move = Path.rename

    def rename(path: Path, target: Path) -> Path:
        nonlocal moves
        if "letters" in path.name and path.suffix != ".claim" and not path.name.startswith("."):
            moves += 1
            if moves == asleep + 1:
                with monkeypatch.context() as awake:
                    awake.setattr(Path, "rename", move)
                    awake.setattr(claims, "take", lambda path: Nobody())
                    awake.setattr(Watch, "free", lambda self: True)
                    update.run_stage(stage, quiet)
                assert contents(stage) == "abc"
        return move(path, target)

    class Nobody:
        def note(self, *_: object) -> None: ...
        def check(self) -> None: ...
        def release(self) -> None: ...

    monkeypatch.setattr(Path, "rename", rename)
    with suppress(StageError):
        update.run_stage(stage, quiet)
    monkeypatch.undo()
    assert stage.changes() == []
    assert contents(stage) == "abc"
    assert [p.name for p in stage.folder.parent.iterdir()] == ["letters"]


def test_a_file_put_back_with_its_time_stamp_is_seen(stage: Copy, source: Path) -> None:
    update.run_stage(stage, quiet)
    before = source.stat()
    source.write_text("xyz")
    os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert stage.changes() == ["text changed"]


def test_results_are_on_the_disk_before_their_folder_has_its_name(
    stage: Copy, flushed: list[tuple[str, Path]]
) -> None:
    for _ in range(2):  # the second replaces the first
        update.run_stage(stage, quiet, force=True)
        whole = flushed.index(("named", stage.folder))
        before = {path.name for what, path in flushed[:whole] if what == "flushed"}
        assert {"0.txt", "1.txt", "2.txt"} <= before
        assert flushed[whole + 1 :] == [("flushed", stage.folder.parent)]
        flushed.clear()
