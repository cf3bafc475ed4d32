"""The paper's tables: which rows, on whom, from which base; on figures that are made up."""

from __future__ import annotations

import datetime
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save_file

from dubbing.engine.disk.files import atomic_write_json
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from dubbing.workshop.lab import paper_tables, results, variants
from dubbing.workshop.lab.evaluation import RESULT_FILE
from dubbing.workshop.lab.variants import Variant
from tests import clips

pytestmark = pytest.mark.medium


PLACE = f"# The paper\n\n{paper_tables.MARKS[0]}\nold\n{paper_tables.MARKS[1]}\n\nAfter.\n"
Calls = list[tuple[str, int, float, str]]


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Ann's clip is long enough for two of the lengths, bob's for one."""
    monkeypatch.setattr(paper_tables, "LENGTHS", (0.4, 1.2, 1.3))
    monkeypatch.setattr(paper_tables, "LENGTH", 0.4)
    monkeypatch.setattr(paper_tables, "HELD_OUT", 0.2)
    people = ""
    for name, frames in (("ann", 36), ("bob", 27)):
        clips.write_clip(tmp_path / f"{name}.mp4", frames)
        people += f"  {name}: {{clip: {name}.mp4, seconds: 0.4, consent: {clips.CONSENT}}}\n"
    path = tmp_path / "m.yaml"
    path.write_text(f"version: 1\noutput: out\nidentities:\n{people}")
    (tmp_path / "paper.md").write_text(PLACE)
    return path


@pytest.fixture
def base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Writes the base of every method anew: it was learned from these people."""

    def write(*known: str) -> None:
        header = str({"identities": [*known], "steps": 7}).replace("'", '"')
        save_file({"x": np.zeros(1, np.float32)}, tmp_path / "base.safetensors", {"dfrf": header})

    bases = {"fast-paper": tmp_path / "base.safetensors"}
    bases["fast-nocrops"] = bases["fast-paper"]
    for module in (paper_tables, variants):
        monkeypatch.setattr(module, "shipped_base", bases.get)
    write("cy")
    return write


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    """Who was measured, with which seed, length and method; PSNR is 30 dB and the references."""
    made: Calls = []

    def evaluate(
        production: Production,
        *,
        methods: tuple[Variant, ...],
        only: tuple[str, ...],
        composition: bool,
        **_: object,
    ) -> None:
        (method,), (name,) = methods, only
        assert not composition  # it takes longer than a run, and no table shows it
        person = production.people[name]
        made.append((name, person.settings.seed, person.seconds, str(method)))
        path = production.output / RESULT_FILE
        path.parent.mkdir(parents=True, exist_ok=True)
        found: dict[str, Any] = results.kept.read(path, dict, "") if path.exists() else {}
        figures: dict[str, Any] = {"psnr": 30.0 + (method.references or 0), "seconds": 9.0}
        figures["p15x"] = {"closure_mcc": 0.5, "offset_frames": -1}
        found.setdefault(name, {})[str(method)] = figures
        atomic_write_json(path, found)

    monkeypatch.setattr(results, "evaluate", evaluate)
    return made


def run(path: Path) -> str:
    out = path.with_name("paper.md")
    how = ["--document", str(out), "--device", "cpu", "--seeds", "0,1", "--commit", "abc"]
    paper_tables.main([str(path), *how])
    return out.read_text()


@pytest.mark.usefixtures("base")
def test_the_tables_and_who_is_in_them(path: Path, calls: Calls) -> None:
    text = run(path)
    assert text.startswith("# The paper\n")
    assert text.endswith("\n\nAfter.\n")
    assert "old" not in text
    assert f"Commit abc, seeds 0, 1, every frame, {datetime.date.today():%d %B %Y}." in text
    assert "Base of dfrf-paper: 7 steps, 1 people." in text
    _, references, lengths, warp, ladder = text.split(", P15:")
    for count in (1, 2, 4, 6):
        assert f"| `bob` | dfrf-paper-{count}, 0.4 s | {30 + count}.00 ± 0.00 |" in references
    assert "| median of 2 | dfrf-nocrops-4, 0.4 s | 34.00 ± 0.00 |" in references
    # Bob's clip holds one of the lengths. Beside the longest, too little of ann's is held out.
    assert "| `ann` | nerf, 1.2 s |" in lengths
    assert "| `ann` | dfrf-paper-4, 0.4 s |" in lengths
    assert "`bob` | nerf, 1.2 s" not in text
    assert "median of 2 | nerf, 1.2 s" not in text
    assert ", 1.3 s" not in text
    assert "| `ann` | dfrf-paper-4-nowarp, 0.4 s |" in warp
    assert "| 0.500 ± 0.000 | -1.0 ± 0.0 |" in warp  # P15x, in a table of its own
    steps = ["ad-nerf-nolips", "dfrf-paper-4", "dfrf-nocrops-4", "dfrf"]
    places = [ladder.index(f"| `bob` | {step}, 0.4 s |") for step in steps]
    assert places == sorted(places)


def test_a_row_of_several_tables_is_measured_once_and_a_killed_run_goes_on(
    path: Path, calls: Calls, base: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = results.evaluate

    def killed(*given: Any, **more: Any) -> Any:
        if len(calls) == 9:
            raise KeyboardInterrupt
        return whole(*given, **more)

    monkeypatch.setattr(results, "evaluate", killed)
    with pytest.raises(KeyboardInterrupt):
        run(path)
    monkeypatch.setattr(results, "evaluate", whole)
    shutil.rmtree(path.with_name("out"))  # as on another machine, which has the document's figures
    text = run(path)
    # 2 methods of 4 references and one without warp, 3 others; those of the middle length again.
    assert len(set(calls)) == 2 * (2 * (2 * 5 + 3) + 4)
    assert len(calls) == len(set(calls)) + 1  # the seed that the kill tore
    before = len(calls)
    shutil.rmtree(path.with_name("out"))
    assert run(path) == text
    assert len(calls) == before
    base("cy", "dan")  # other bases: what starts from them is measured again
    run(path)
    assert {method for *_, method in calls[before:]} == {
        str(row.variant)
        for rows in paper_tables.rows_of_tables().values()
        for row in rows
        if row.variant.method in paper_tables.METHODS
    }


def test_a_base_that_knows_somebody_is_refused(
    path: Path, calls: Calls, base: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    base("bob")
    with pytest.raises(SystemExit):
        run(path)
    assert "learned from bob, so it cannot be measured there" in capsys.readouterr().err
    assert not calls


@pytest.mark.usefixtures("base")
def test_clips_are_prepared_once_for_all_lengths_and_seeds(
    path: Path, calls: Calls, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = set()
    monkeypatch.setattr(
        results,
        "_share_prepared",
        lambda first, *_: shared.add(first.output.relative_to(path.parent)),
    )
    run(path)
    assert shared == {Path("out/learned-0.4/seeds/0")}
    assert set(load(path).people) == {"ann", "bob"}


def test_the_document_of_the_project_shows_all_its_figures() -> None:
    path = Path(__file__).parents[4] / "docs" / "development" / "paper.md"
    done = results.kept.read(path.with_suffix(".json"), dict[str, Any], "")
    tables = paper_tables.rows_of_tables()
    request = results.Request((0, 1, 2), (), 1, None, None, "cpu", "abc")
    shown = path.read_text()
    made = paper_tables.document(shown, tables, request, list(done.values()), datetime.date.min)
    first = "**Table 1"  # above it are the commit, the day and the machine
    assert made[made.index(first) :] == shown[shown.index(first) :]
    titles = {str(row) for rows in tables.values() for row in rows}
    people = {"german_news", "noem_256", "andrew1_256"}
    for run in done.values():
        assert set(run) == people
        # The two shorter clips hold no 20 s beside which something is held out.
        assert [len(titles - set(run[name])) for name in sorted(people)] == [0, 4, 4]
        assert all(set(found) <= titles for found in run.values())
