"""Every field of every stage, changed one by one: that stage is stale, and those after it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import pytest

from dubbing.batch import jobs
from dubbing.engine.graph.fields import counted
from dubbing.engine.graph.graph import Jobs
from dubbing.engine.graph.stage import Progress, Stage
from dubbing.engine.planning import planner
from dubbing.manifest.manifest import load
from dubbing.pipeline import STAGES
from dubbing.stages.draft import Draft
from tests import clips, fakes
from tests.dubbing.batches import dub
from tests.dubbing.provenance.chain import write_chain

pytestmark = pytest.mark.medium

OF_ALL = {"id", "folder"}  # of the base class


@dataclass(frozen=True, kw_only=True)
class Another(Stage):
    """A stage that was never made."""

    def run(self, out: Path, progress: Progress) -> None:
        raise AssertionError


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A signed scene with music, of a person who learned from two clips; all is up to date."""
    pytest.importorskip("c2pa")
    place = tmp_path_factory.mktemp("every")
    write_chain(place)
    clips.write_clip(place / "ann.mp4", 40)
    clips.write_clip(place / "two.mp4", 50)
    clips.write_sound(place / "it.wav", 2.0)
    clips.write_sound(place / "me.wav", 2.0, hertz=97)
    (place / "own.key").write_bytes(bytes(range(32)))
    (place / "it.srt").write_text(
        "1\n00:00:00,400 --> 00:00:00,800\nANN: One.\n\n"
        "2\n00:00:01,000 --> 00:00:01,200\nBEN: Two.\n"
    )
    path = place / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        f"  ann: {{clips: [ann.mp4, two.mp4], seconds: 9, consent: {clips.CONSENT}}}\n"
        "dubs:\n  - {name: it, clip: two.mp4, lines: it.srt, speakers: {ANN: ann}, audio: it.wav,\n"
        "     music_effects: me.wav, label: {credits: {seconds: 1}}, mark: {key: own.key},\n"
        "     certificate: signer.pem, key: signer.key}\n"
    )
    with pytest.MonkeyPatch.context() as patch:
        fakes.install(patch.setattr)
        for draft in (False, True):
            result, _ = dub(path, draft=draft)
            assert result.code == 0, result.outcomes
    return path


def variants(value: Any, elsewhere: Path) -> Iterator[tuple[str, Any, bool]]:
    """Values that differ from one in a single place: where, the value, and whether it counts."""
    if isinstance(value, Stage):
        yield "", Another(folder=elsewhere.parent / "another"), True
    elif isinstance(value, Path):
        yield "", elsewhere, True
    elif is_dataclass(value):
        counts = counted(value)
        for field in fields(value):
            for at, other, inner in variants(getattr(value, field.name), elsewhere):
                changed = replace(cast(Any, value), **{field.name: other})
                yield f".{field.name}{at}", changed, inner and field.name in counts
    elif isinstance(value, Mapping) and value:
        for key, one in value.items():
            for at, other, counts_too in variants(one, elsewhere):
                yield f"[{key}]{at}", {**value, key: other}, counts_too
        yield "[one more]", {**value, "one more": next(iter(value.values()))}, True
    elif isinstance(value, tuple) and value:
        for k, one in enumerate(value):
            for at, other, counts_too in variants(one, elsewhere):
                yield f"[{k}]{at}", (*value[:k], other, *value[k + 1 :]), counts_too
        yield "[one more]", (*value, value[0]), True
    else:
        yield "", _other(value), True


def _other(value: Any) -> Any:
    match value:
        case bool():
            return not value
        case int() | float() | Fraction():
            return value + 1
        case str():
            return f"{value}x"
        case None | ():
            return 3
        case [*items]:
            return [*items, 3]
        case _:
            return "other"


def states(planned: Jobs) -> tuple[set[Stage], set[Stage]]:
    """Stages that are stale, and that come after those."""
    rows = planner.rows(planned)
    found: dict[str, set[Any]] = {planner.RUN: set(), planner.AFTER: set(), "up to date": set()}
    for row in rows:
        assert row.stage is not None, row
        found[row.state].add(row.stage.id)
    return found[planner.RUN], found[planner.AFTER]


def change(stage: Stage, name: str, value: Any) -> None:
    """Set a field of a stage in place, so that the stages after it have it, too."""
    object.__setattr__(stage, name, value)
    vars(stage).pop("_declared", None)


@pytest.mark.parametrize("kind", STAGES, ids=lambda kind: kind.kind)
def test_a_field_makes_its_stage_stale_and_those_after_it(made: Path, kind: type[Stage]) -> None:
    planned = jobs.build(load(made), draft=kind is Draft)
    assert states(planned) == (set(), set())
    elsewhere = made.parent / "elsewhere"
    elsewhere.write_text("something else")
    every = [stage for job in planned.all() for stage in job.stages.values()]
    tried = 0
    for stage in [stage for stage in every if isinstance(stage, kind)][:1]:
        later = {one.id for one in every if stage.id in one.ancestors()}
        counts = counted(stage)
        for name in {field.name for field in fields(stage)} - OF_ALL:
            before = getattr(stage, name)
            for at, value, inner in variants(before, elsewhere):
                change(stage, name, value)
                expected = ({stage.id}, later) if inner and name in counts else (set(), set())
                assert states(planned) == expected, f"{kind.kind}.{name}{at}"
                change(stage, name, before)
                tried += name in counts
    assert tried > 2


def test_a_stage_gets_nothing_that_it_does_not_declare(made: Path) -> None:
    """It has its fields, and knows no person, no dub and no production."""
    for job in jobs.build(load(made)).all():
        for stage in job.stages.values():
            named = {field.name for field in fields(stage)} | {"_declared"}
            assert {*vars(stage)} <= named
            module = type(stage).__module__
            assert "dubbing.production" not in "".join(stage_imports(module))


def stage_imports(module: str) -> set[str]:
    from dubbing.engine.graph.code_version import reachable
    from dubbing.stages.base import DubbingStage

    return reachable(module, DubbingStage.packages, DubbingStage.without_effect)
