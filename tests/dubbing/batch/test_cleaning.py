"""Files that a manifest no longer asks for are listed, and removed where one says so."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from dubbing.batch.cleaning import surplus
from dubbing.cli import machine_commands
from dubbing.cli.main import app
from dubbing.engine.disk import claims
from dubbing.manifest.manifest import load
from tests import clips, fakes
from tests.dubbing.batches import dub

pytestmark = pytest.mark.medium

EDITS = "{take: TAKE, takes: {late: {shift: 40}, soft: {strength: 0.5}}}"
DUBS = """\
  - {name: it, identity: ann, audio: it.wav}
  - {name: de, identity: ben, audio: de.wav}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two people, and a dub of each that was made."""
    place = tmp_path_factory.mktemp("clean")
    clips.write_clip(place / "ann.mp4", 30)
    clips.write_clip(place / "ben.mp4", 31)
    for name, hertz in (("it", 220), ("de", 330)):
        clips.write_sound(place / f"{name}.wav", 1.0, hertz=hertz)
    with pytest.MonkeyPatch.context() as patch:
        fakes.install(patch.setattr)
        dub(written(place / "m.yaml", ("ann", "ben"), DUBS))
    return place


def written(path: Path, people: tuple[str, ...], dubs: str) -> Path:
    own = [
        f"  {name}: {{clip: {name}.mp4, seconds: 1, consent: {clips.CONSENT}}}" for name in people
    ]
    path.write_text("\n".join(["version: 1", "output: out", "identities:", *own, "dubs:", dubs]))
    return path


@pytest.fixture
def path(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of its manifest."""
    fakes.install(monkeypatch.setattr)
    shutil.copytree(made, tmp_path / "job")
    return tmp_path / "job" / "m.yaml"


def call(path: Path, *more: str, code: int = 0) -> Result:
    result = CliRunner().invoke(app, ["clean", str(path), *more])
    assert result.exit_code == code, result.output
    return result


def names(path: Path, *, takes: bool = False) -> set[str]:
    found = load(path)
    own = surplus(found, takes=takes)
    assert all(one.size >= 0 for one in own)
    return {str(one.path.relative_to(found.output)) for one in own}


def files(folder: Path) -> set[str]:
    return {str(one.relative_to(folder)) for one in folder.rglob("*") if one.is_file()}


def of_ben(name: str) -> bool:
    """Whether a file was made for Ben, or for the dub that he is in."""
    return name.startswith(("de.", "work/dubs/de/", "work/identities/ben/", "work/thumbnails/de"))


def test_nothing_is_listed_of_what_is_asked_for(path: Path) -> None:
    assert names(path) == names(path, takes=True) == set()
    assert "nothing to remove" in call(path, "--yes").output
    assert dub(path)[1] == []


def test_a_dub_and_a_person_that_are_gone(path: Path) -> None:
    out, before = path.parent / "out", files(path.parent / "out")
    written(path, ("ann",), DUBS.splitlines()[0])
    (out / "work" / "dubs" / "de" / "notes.txt").write_text("lies in a folder of stages")
    (out / "de.txt").write_text("was not made by the tool")
    (out / "de.sync.json").write_text("{}")  # no more as it was made
    listed = call(path).output
    assert "nothing was removed; --yes removes it" in listed
    assert files(out) >= before
    assert [line.split()[-1] for line in listed.splitlines()[:-2]] == [
        *("de.edl", "de.lines.csv", "de.lines.jsonl", "de.mp4"),
        *("work/dubs/de", "work/identities/ben", "work/thumbnails/de.jpg"),
    ]
    sizes = [float(line.split()[0]) for line in listed.splitlines()[:-1]]
    assert sum(sizes[:-1]) == pytest.approx(sizes[-1], abs=0.05 * len(sizes))
    call(path, "--yes")
    left = {name for name in before if not of_ben(name)} | {"de.txt", "de.sync.json"}
    assert files(out) == left
    assert dub(path)[1] == []


def test_takes_go_only_when_that_is_said(path: Path) -> None:
    def choose(take: str) -> None:
        edits = f", edits: {EDITS.replace('TAKE', take)}}}"
        written(path, ("ann", "ben"), DUBS.replace("it.wav}", f"it.wav{edits}"))
        assert dub(path)[0].code == 0

    for take in ("late", "soft", "''"):
        choose(take)
    assert names(path) == set()
    (cue,) = load(path).dubs["it"].cues
    cues = Path("work/dubs/it/cues")
    late, soft = (str(cues / cue.folder_of(take)) for take in ("late", "soft"))
    assert names(path, takes=True) == {str(cues / cue.name / "takes")}
    choose("late")
    unnamed = {str(cues / cue.name / part) for part in ("render", "figures.json")}
    assert names(path, takes=True) == {soft, *unnamed}
    # One that is no longer in the manifest goes without that.
    path.write_text(path.read_text().replace(", soft: {strength: 0.5}", ""))
    assert names(path) == {soft}
    assert late not in names(path, takes=True)
    call(path, "--takes", "--yes")
    assert not (path.parent / "out" / cues / cue.name / "render").exists()
    assert dub(path)[1] == []


def test_takes_of_other_lengths_go_only_when_that_is_said(path: Path) -> None:
    clips.write_sound(path.parent / "short.wav", 0.5)
    for take in ("''", "short"):
        edits = f", edits: {{take: {take}, takes: {{short: {{audio: short.wav}}}}}}}}"
        written(path, ("ann", "ben"), DUBS.replace("it.wav}", f"it.wav{edits}"))
        assert dub(path)[0].code == 0
    assert names(path) == set()
    assert names(path, takes=True) == {"work/dubs/it/cues/ann_0000000-0000025"}


def test_what_is_read_stays(path: Path) -> None:
    """A result of a dub that is gone may be the film or the recording of another by now."""
    written(path, ("ann",), "  - {name: it, identity: ann, audio: out/de.mp4}")
    found = names(path)
    assert "de.mp4" not in found
    assert "de.edl" in found


def test_a_link_is_not_followed(path: Path) -> None:
    work, elsewhere = path.parent / "out" / "work", path.parent / "elsewhere"
    (work / "dubs" / "de").rename(elsewhere)
    (work / "dubs" / "de").symlink_to(elsewhere)
    written(path, ("ann",), DUBS.splitlines()[0])
    before = files(elsewhere)
    assert "work/dubs/de" not in names(path)
    call(path, "--yes")
    assert files(elsewhere) == before
    work.rename(path.parent / "work")
    work.symlink_to(path.parent / "work")
    assert not any(name.startswith("work") for name in names(path))


def test_a_run_that_is_at_work_is_left_alone(path: Path) -> None:
    written(path, ("ann",), DUBS.splitlines()[0])
    with claims.hold(path.parent / "out" / "work" / "dubs" / "de" / "composite"):
        assert "work/dubs/de" not in names(path)
    assert "work/dubs/de" in names(path)


def test_work_of_other_settings_goes_and_that_of_now_stays(path: Path) -> None:
    job = path.parent / "out" / "work" / "identities" / "ann"
    for key in ("0" * 12, ""):
        (job / f"finetune.partial-{key}").mkdir()
    (job / "finetune.partial-").rename(next(iter(partials(path))))
    assert names(path) == {"work/identities/ann/finetune.partial-000000000000"}


def partials(path: Path) -> list[Path]:
    from dubbing.batch import jobs
    from dubbing.stages.finetune import Finetune

    return [jobs.build(load(path)).by_label["identity/ann"].stage(Finetune).partial()]


def test_a_damaged_film_costs_nobody_their_work(path: Path) -> None:
    (path.parent / "ben.mp4").write_bytes(b"damaged")
    assert names(path) == set()


def test_the_output_of_two_manifests_is_left_alone(path: Path) -> None:
    other = written(
        path.with_name("other.yaml"), ("ann",), "  - {name: fr, identity: ann, audio: de.wav}"
    )
    dub(other)
    result = CliRunner().invoke(app, ["clean", str(path), "--yes"])
    assert result.exit_code != 0
    assert "give each manifest an output of its own" in str(result.exception)


@pytest.mark.parametrize(("answer", "gone"), [("y\n", True), ("n\n", False), ("\n", False)])
def test_a_terminal_is_asked(
    path: Path, monkeypatch: pytest.MonkeyPatch, answer: str, gone: bool
) -> None:
    class Terminal:
        @staticmethod
        def isatty() -> bool:
            return True

    written(path, ("ann",), DUBS.splitlines()[0])
    monkeypatch.setattr(
        machine_commands, "sys", type("System", (), {"stdin": Terminal, "stdout": Terminal})
    )
    result = CliRunner().invoke(app, ["clean", str(path)], input=answer)
    assert result.exit_code == 0, result.output
    assert (path.parent / "out" / "de.mp4").exists() is not gone
