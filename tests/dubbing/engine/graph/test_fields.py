"""The fields of a stage are its dependencies: files, stages and plain data, but for settings."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import pytest

from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Stage
from dubbing.engine.graph.stage_id import StageId


class ReadText(Stage):
    """A stage that others read."""


@dataclass(frozen=True)
class Voice:
    """Holds an input, a parameter and a setting."""

    sound: Path
    gain: float
    shown: Setting[str] = "Ann"


@dataclass(frozen=True, kw_only=True)
class Mix(Stage):
    """Has fields of all kinds."""

    clip: Path
    before: Stage
    rate: Fraction = Fraction(24000, 1001)
    size: int | None = None
    title: str | None = None
    taps: tuple[float, ...] = ()
    sides: tuple[Path | None, ...] = ()
    voices: tuple[Voice, ...] = ()
    weights: Mapping[str, Path] = field(default_factory=dict)
    gains: Mapping[Any, Any] = field(default_factory=dict)
    device: Setting[str] = "cpu"
    cache: Setting[Path | None] = None


@dataclass(frozen=True, kw_only=True)
class Odd(Stage):
    """Its field holds anything."""

    value: Any


@dataclass(frozen=True, kw_only=True)
class Choice(Stage):
    """Has a parameter that may be the word setting."""

    of: Literal["parameter", "setting"]


@pytest.fixture
def mix(tmp_path: Path) -> Mix:
    for name in ("clip", "a", "b"):
        (tmp_path / name).write_text(name)
    return Mix(clip=tmp_path / "clip", before=ReadText(id=StageId("job", "read_text")))


def test_a_kind_is_named_after_its_class() -> None:
    assert (ReadText.kind, Mix.kind) == ("read_text", "mix")


def test_files_and_stages_are_inputs_and_plain_data_parameters(mix: Mix) -> None:
    assert mix.inputs == {"clip": mix.clip, "before": mix.before}
    assert mix.parameters == {
        "rate": "24000/1001",
        "size": None,
        "title": None,
        "taps": [],
        "sides": [],
        "voices": [],
        "weights": {},
        "gains": {},
    }


def test_what_names_a_stage_and_places_it_does_not_count(mix: Mix) -> None:
    """Nor do settings."""
    for other in (
        replace(mix, id=StageId("other", "mix"), folder=Path("elsewhere")),
        replace(mix, device="cuda", cache=mix.clip),
    ):
        assert (other.inputs, other.parameters) == (mix.inputs, mix.parameters)
        assert other.key() == mix.key()
        assert other.fingerprints() == mix.fingerprints()


def test_inputs_are_named_after_their_place(mix: Mix) -> None:
    a, b = mix.clip.with_name("a"), mix.clip.with_name("b")
    made = replace(
        mix,
        sides=(a, None, b),
        voices=(Voice(a, 0.5), Voice(b, 1.0, "Bob")),
        weights={"ears": a, "eyes": b},
        gains={"low": {"film": a, "of": 3}, 7: (1, True)},
    )
    assert made.inputs == {
        "clip": mix.clip,
        "before": mix.before,
        "sides 0": a,
        "sides 2": b,
        "voices 0 sound": a,
        "voices 1 sound": b,
        "weights ears": a,
        "weights eyes": b,
        "gains low film": a,
    }
    plain = {name: value for name, value in made.parameters.items() if value not in (None, [])}
    assert plain == {
        "rate": "24000/1001",
        "sides": [None, None, None],
        "voices": [{"gain": 0.5}, {"gain": 1.0}],
        "gains": {"low": {"of": 3}, "7": [1, True]},
    }
    # As they are read again from a record.
    assert json.loads(json.dumps(made.parameters)) == made.parameters


def test_a_field_of_inputs_alone_is_no_parameter(mix: Mix) -> None:
    made = replace(mix, sides=(mix.clip,), weights={"ears": mix.clip})
    assert {"sides", "weights"} & {*mix.parameters} == {"sides", "weights"}
    assert not {"sides", "weights"} & {*made.parameters}
    assert Odd(value=mix.clip).parameters == {}


@pytest.mark.parametrize(
    "changed",
    [{"rate": Fraction(25)}, {"size": 512}, {"taps": (0.5,)}, {"gains": {"low": 1}}, {"title": ""}],
    ids=str,
)
def test_a_parameter_changes_the_key(mix: Mix, changed: dict[str, Any]) -> None:
    other = replace(mix, **changed)
    assert other.key() != mix.key()
    (name,) = changed
    found, own = other.fingerprints(), mix.fingerprints()
    assert [of for of in found if found[of] != own[of]] == [name]


def test_a_setting_inside_of_a_dataclass_changes_no_key(mix: Mix) -> None:
    one = replace(mix, voices=(Voice(mix.clip, 0.5),))
    assert replace(mix, voices=(Voice(mix.clip, 0.5, "Bob"),)).key() == one.key()
    assert replace(mix, voices=(Voice(mix.clip, 0.6),)).key() != one.key()


def test_a_parameter_may_be_the_word_setting() -> None:
    assert Choice(of="setting").parameters == {"of": "setting"}


def test_the_content_of_a_file_counts_and_its_path_does_not(mix: Mix) -> None:
    a, key = mix.clip.with_name("a"), mix.key()
    voiced = replace(mix, voices=(Voice(a, 0.5),), weights={"ears": a})
    before = voiced.key()
    moved = a.rename(a.with_name("moved"))
    assert voiced.key() != before  # it is gone
    there = replace(mix, voices=(Voice(moved, 0.5),), weights={"ears": moved})
    assert there.key() == before
    moved.write_text("other")
    assert there.key() != before
    assert mix.key() == key
    mix.clip.write_text("other")
    assert mix.key() != key


@pytest.mark.parametrize("value", [object(), {1, 2}, b"bytes", print, 1j, Stage, ReadText])
def test_anything_else_is_refused(value: Any) -> None:
    with pytest.raises(TypeError, match=r"^value is no plain data"):
        Odd(value=value).key()
    with pytest.raises(TypeError, match=r"^value of 1 is no plain data"):
        Odd(value={"of": (1, value)}).key()


def test_two_inputs_of_one_name_are_refused(mix: Mix) -> None:
    """Only one of them would count."""
    with pytest.raises(TypeError, match="two inputs are named gains low film"):
        replace(mix, gains={"low film": mix.clip, "low": {"film": mix.clip}}).key()
