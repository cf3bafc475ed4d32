"""Tables with their spread, written into a document; what was measured is not measured again."""

from __future__ import annotations

import datetime
import re
from pathlib import Path
from typing import Any

import pytest

from dubbing.engine.disk.files import atomic_write_json
from dubbing.errors import ExplainedError
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from dubbing.workshop.lab import results
from dubbing.workshop.lab.evaluation import RESULT_FILE
from dubbing.workshop.lab.result_tables import table
from dubbing.workshop.lab.variants import Variant
from tests import clips

pytestmark = pytest.mark.medium


PLACE = f"# Results\n\n{results.BEGIN}\nold\n{results.END}\n\nAfter.\n"
Calls = list[tuple[str, int, str, int]]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    clips.write_clip(tmp_path / "ann.mp4", 30)
    path = tmp_path / "m.yaml"
    person = f"{{clip: ann.mp4, seconds: 0.8, consent: {clips.CONSENT}}}"
    path.write_text(f"version: 1\noutput: out\nidentities:\n  ann: {person}\n  bob: {person}\n")
    return path


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    """Who was measured, with which seed; PSNR is 30 dB and the seed, and 2 more for bob."""
    made: Calls = []

    def evaluate(
        production: Production,
        *,
        methods: tuple[Variant, ...],
        only: tuple[str, ...],
        every: int,
        composition: bool,
        **_: object,
    ) -> None:
        (method,), (name,) = map(str, methods), only
        seed = production.people[name].settings.seed
        made.append((name, seed, method, every))
        path = production.output / RESULT_FILE
        path.parent.mkdir(parents=True, exist_ok=True)
        found: dict[str, Any] = results.kept.read(path, dict, "") if path.exists() else {}
        figures: dict[str, Any] = {
            "psnr": 30.0 + seed + 2 * (name == "bob"),
            "frames": 10,
            "steps": 5,
        }
        figures["p15x"] = {"opening_r": 0.5 + seed / 10}
        if composition and name == "ann":  # bob is learned without crops
            figures["composition"] = {"mouth crops": 0.8 + seed / 100, "no warp changes dB": 50.0}
        found.setdefault(name, {})[method] = figures
        atomic_write_json(path, found)

    monkeypatch.setattr(results, "evaluate", evaluate)
    return made


def run(path: Path, *more: str) -> str:
    out = path.with_name("results.md")
    if not out.exists():
        out.write_text(PLACE)
    how = ["--document", str(out), "--device", "cpu", "--seeds", "0,1,2", "--commit", "abc"]
    results.main([*how, *more, str(path)])
    return out.read_text()


def test_the_document_says_mean_and_spread_and_where_they_come_from(
    path: Path, calls: Calls
) -> None:
    text = run(path, "--every", "5")
    assert "| `ann` | dfrf | 31.00 ± 1.00 | 10 | 5 |" in text
    assert "| `bob` | dfrf | 33.00 ± 1.00 | 10 | 5 |" in text
    assert "| median of 2 | dfrf | 32.00 ± 1.00 | 10 | 5 |" in text
    assert "| `ann` | dfrf | 0.600 ± 0.100 |" in text  # P15x, in a table of its own
    assert "| `ann` | dfrf | 0.810 ± 0.010 |" in text  # what the mouth is made of
    assert "| `ann` | dfrf | 50.0 ± 0.0 |" in text
    today = f"{datetime.date.today():%d %B %Y}"
    assert f"Commit abc, seeds 0, 1, 2, one frame of 5 (P15), {today}." in text
    shorter = run(path, "--every", "5", "--seconds", "2.5")
    assert f"one frame of 5 (P15), 2.5 s of each protocol at most, {today}." in shorter
    assert re.search(r"Machine: \d+ cores of .+, torch threads: \d+, no GPU\.", text)
    assert text.startswith("# Results\n")
    assert text.endswith("\n\nAfter.\n")
    assert "old" not in text
    assert run(path, "--every", "5") == text  # no second place for tables


def test_what_the_same_code_measured_is_not_measured_again(
    path: Path, calls: Calls, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(path)
    everything = [(name, seed, "dfrf", 1) for seed in (0, 1, 2) for name in ("ann", "bob")]
    assert calls == everything
    run(path)
    assert calls == everything
    run(path, "--method", "dfrf", "--method", "nerf")
    assert calls[6:] == [(name, seed, "nerf", 1) for name, seed, _, _ in everything]
    calls.clear()
    before = "bob: {clip: ann.mp4, seconds: "
    path.write_text(path.read_text().replace(before + "0.8", before + "0.6"))
    run(path)
    assert calls == [("bob", seed, "dfrf", 1) for seed in (0, 1, 2)]
    calls.clear()
    monkeypatch.setattr(results, "code_version", lambda *_: "another")
    run(path)
    assert calls == everything


def test_each_seed_has_a_folder_and_learns_with_it(path: Path, calls: Calls) -> None:
    run(path)
    manifest = load(path)
    one = results.with_seed(manifest, 1)
    assert one.output == manifest.output / "seeds" / "1"
    assert {person.settings.seed for person in one.people.values()} == {1}
    assert (one.output / RESULT_FILE).is_file()


def test_a_clip_is_prepared_for_the_first_seed_alone(path: Path) -> None:
    first, second = (results.with_seed(load(path), seed) for seed in (0, 1))
    there, here = (m.output / "work" / "identities" / "ann" / "prepare" for m in (first, second))
    record = {
        "version": "1",
        "key": "k",
        "parameters": {},
        "inputs": {},
        "outputs": {},
        "seconds": 1.0,
    }
    there.mkdir(parents=True)
    (there / "matte.mkv").write_bytes(b"matte")
    atomic_write_json(there / "stage.json", record)
    results._share_prepared(first, second, "ann")
    assert (here / "matte.mkv").samefile(there / "matte.mkv")
    results._share_prepared(first, first, "ann")  # the first one's own stays
    assert (there / "matte.mkv").is_file()


def test_a_figure_of_one_seed_does_not_appear() -> None:
    columns = (("PSNR", "psnr", 1), ("lag", "lag_ms", 0))
    runs = [{"ann": {"dfrf": {"psnr": 30.0, "lag_ms": 5.0}}}, {"ann": {"dfrf": {"psnr": 31.0}}}]
    assert table(columns, runs) == [
        "| clip | method | PSNR |",
        "| --- | --- | --- |",
        "| `ann` | dfrf | 30.5 ± 0.7 |",
    ]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--seeds", "1"), "two or more"),
        (("--seeds", "1,1"), "two or more"),
        (("--seeds", "one"), "numbers with commas"),
        (("--every", "0"), "1 or more"),
        (("--seconds", "0"), "more than 0"),
    ],
)
def test_a_wrong_call_is_said(
    path: Path,
    calls: Calls,
    capsys: pytest.CaptureFixture[str],
    more: tuple[str, ...],
    message: str,
) -> None:
    with pytest.raises(SystemExit):
        run(path, *more)
    assert message in capsys.readouterr().err
    assert not calls


def test_a_document_without_a_place_is_refused_before_anything_is_measured(
    path: Path, calls: Calls, capsys: pytest.CaptureFixture[str]
) -> None:
    path.with_name("results.md").write_text("# Results\n")
    with pytest.raises(SystemExit):
        run(path)
    assert "no place for tables" in capsys.readouterr().err
    assert not calls
    request = results.Request((0, 1), (Variant(),), 1, None, None, "cpu", "abc")
    with pytest.raises(ExplainedError, match="no place"):
        results.document("", request, [], datetime.date.today())


def test_one_name_in_two_manifests_is_refused(
    path: Path, calls: Calls, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        run(path, "--", str(path))
    assert "'ann' is in two manifests" in capsys.readouterr().err


def test_the_document_of_the_project_has_a_place() -> None:
    text = (Path(__file__).parents[4] / "docs" / "development" / "results.md").read_text()
    request = results.Request((0, 1), (Variant(),), 1, None, None, "cpu", "abc")
    assert results.BEGIN in results.document(text, request, [{}, {}], datetime.date.today())
