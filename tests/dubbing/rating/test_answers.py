"""Answers are added up; those that do not belong to a page are refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import binomtest
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.errors import CallError, ExplainedError
from dubbing.rating import answers as told
from dubbing.rating.answers import Share
from dubbing.rating.pairs import KEY, Key
from tests.dubbing.rating.versions import PARTS, side


def key_of(count: int = 4) -> Key:
    """Pairs p0, p1, ...; version 1 is second in even ones, and nearer everywhere."""
    pairs: list[Any] = []
    for k in range(count):
        sides = [side(0, PARTS, 0.7), side(1, PARTS | {"timing": 0.95}, 0.9)]
        first, second = sides if k % 2 == 0 else sides[::-1]
        pairs.append({"id": f"p{k}", "dub": f"d{k}", "first": first, "second": second})
    return Key(dfrf_pairs=1, page="abc", versions=["a.yaml", "b.yaml"], pairs=pairs)


def write(folder: Path, name: str, *words: str, **other: Any) -> Path:
    path = folder / f"answers_{name}.json"
    given = {f"p{k}": word for k, word in enumerate(words)}
    content = {"dfrf_answers": 1, "page": "abc", "person": name, "answers": given} | other
    path.write_text(json.dumps(content))
    return path


def test_sides_are_turned_back_to_versions(tmp_path: Path) -> None:
    ann = write(tmp_path, "ann", "second", "first", "second", "first")
    ben = write(tmp_path, "ben", "second", "second", "same")
    found = told.read([ann, ben], key_of())
    assert [*told.preferences(found)] == [(0, 1, Share(1 + 0.5, 7))]
    # Of three pairs with two answers: alike, contrary, half.
    assert told.among_people(found) == Share(1.5, 3)
    assert told.with_closeness(found) == Share(5.5, 7)


def test_the_interval_is_that_of_a_binomial_share() -> None:
    for counted, of in ((3, 10), (0, 5), (50, 50), (61, 100)):
        expected = binomtest(counted, of).proportion_ci(0.95, "wilson")
        assert Share(counted, of).interval == pytest.approx(tuple(expected), abs=1e-4)


@pytest.mark.parametrize(
    ("other", "error", "words"),
    [
        ({"page": "abd"}, CallError, "of another page"),
        ({"answers": {"p9": "first"}}, ExplainedError, "a pair that the page does not have: 'p9'"),
        ({"answers": {"p1": "left"}}, ExplainedError, "holds something else: answers.p1"),
        ({"answers": {}}, ExplainedError, "holds no answers"),
        ({"person": ""}, ExplainedError, "holds something else: person"),
        ({"dfrf_answers": 2}, ExplainedError, "holds something else: dfrf_answers"),
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, other: dict[str, Any], error: type[ExplainedError], words: str
) -> None:
    with pytest.raises(error, match=words) as caught:
        told.read([write(tmp_path, "ann", "first", **other)], key_of())
    assert "answers_ann.json" in caught.value.where
    assert caught.value.remedy


def test_nobody_is_counted_twice(tmp_path: Path) -> None:
    path = write(tmp_path, "ann", "first")
    with pytest.raises(CallError, match="a second file of 'ann'"):
        told.read([path, path], key_of())


def test_the_command_says_it_in_words(tmp_path: Path) -> None:
    (tmp_path / KEY).write_text(json.dumps(key_of()))
    ann = write(tmp_path, "ann", "second", "first", "second", "first")
    ben = write(tmp_path, "ben", "second")
    found = CliRunner().invoke(app, ["rate", str(tmp_path), "--answers", str(ann), str(ben)])
    assert found.exit_code == 0, found.output
    assert "5 answers about 4 of 4 pairs, by ann, ben" in found.output
    assert "a.yaml preferred to b.yaml: 0 % (0 to 43 %) of 5" in found.output
    assert "two people say the same: 100 %" in found.output
    assert "WEIGHTS in dubbing/sync/closeness.py" in found.output
    (tmp_path / KEY).write_text("{")
    found = CliRunner().invoke(app, ["rate", str(tmp_path), "--answers", str(ann)])
    assert "the key of the pairs holds something else" in str(found.exception)


def test_a_page_without_closeness_gives_no_weights(tmp_path: Path) -> None:
    key = key_of()
    for pair in key["pairs"]:
        pair["first"] |= {"closeness": None, "parts": {}}
    (tmp_path / KEY).write_text(json.dumps(key))
    call = ["rate", str(tmp_path), "--answers", str(write(tmp_path, "ann", "same"))]
    found = CliRunner().invoke(app, call)
    assert "the greater closeness is preferred: no answers tell" in found.output
    assert "no weights can be fitted" in found.output
