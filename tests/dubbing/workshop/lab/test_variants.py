"""Methods that are compared: what each changes in a person's settings, and its base."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dubbing.errors import ExplainedError
from dubbing.manifest.manifest import load
from dubbing.pipeline import person_job
from dubbing.production.person import Person
from dubbing.shipped.base import BASE, PAPER_BASE
from dubbing.stages.finetune import Finetune
from dubbing.workshop.lab.variants import PRESET_OF_METHOD, Variant, preset_of, variants
from tests import clips

pytestmark = pytest.mark.medium


@pytest.fixture
def own(tmp_path: Path) -> Person:
    clips.write_clip(tmp_path / "ann.mp4", 30)
    path = tmp_path / "m.yaml"
    person = f"{{clip: ann.mp4, seconds: 0.8, consent: {clips.CONSENT}}}"
    path.write_text(f"version: 1\noutput: out\nidentities:\n  ann: {person}\n")
    return load(path).people["ann"]


def test_another_number_of_references_is_another_fine_tune(own: Person, tmp_path: Path) -> None:
    plain, two, still = (
        person_job(person, tmp_path).stage(Finetune)
        for person in (own, Variant(references=2).of(own), Variant(warp=False).of(own))
    )
    assert len({stage.key() for stage in (plain, two, still)}) == 3
    assert (two.settings.references, two.settings.preset) == (2, "fast")
    assert not still.settings.warp


def test_what_is_measured_is_learned_from_its_own_seconds_alone(own: Person) -> None:
    assert own.settings.turned
    assert not Variant("dfrf").of(own).settings.turned


def test_references_of_the_manifest_are_those_of_dfrf_alone(own: Person) -> None:
    three = replace(own, settings=replace(own.settings, references=3))
    assert Variant("dfrf").of(three).settings.references == 3
    assert Variant("dfrf", references=1).of(three).settings.references == 1
    assert Variant("dfrf-nocrops").of(three).settings.references is None


def test_names_of_variants() -> None:
    assert str(Variant("dfrf-paper")) == "dfrf-paper"
    assert str(Variant("dfrf-paper", 4, False, Path("b"))) == "dfrf-paper-4-nowarp"


def test_which_base_a_method_starts_from(own: Person) -> None:
    """The shipped one and the person's own serve those whose speech networks learn from lips."""
    mine, given = Path("mine.safetensors"), Path("given.safetensors")
    theirs = replace(own, base=mine, own_base=True)
    starts = {
        method: [
            Variant(method).of(own).base,
            Variant(method).of(theirs).base,
            Variant(method, base=given).of(theirs).base,
        ]
        for method in PRESET_OF_METHOD
    }
    nothing = {method: [None, None, given] for method in PRESET_OF_METHOD}
    taught = {method: [BASE, mine, given] for method in ("dfrf", "dfrf-nocrops")}
    assert starts == {**nothing, **taught, "dfrf-paper": [PAPER_BASE, PAPER_BASE, given]}
    paper = replace(theirs, settings=replace(own.settings, preset="paper"))
    assert Variant("paper").of(paper).base == mine
    assert Variant("dfrf").of(paper).base == BASE


@pytest.mark.parametrize(
    ("variant", "message"),
    [
        (Variant("dfrf-2"), r"no method is called dfrf-2 \(--method\)"),
        (Variant("nerf", references=2), r"nerf: .* has no references \(--references\)"),
        (Variant("paper", references=2), r"paper: .* has a fixed number .* \(--references\)"),
        (Variant("ad-nerf", warp=False), r"ad-nerf: .* has no warp \(--no-warp\)"),
    ],
)
def test_what_a_method_does_not_have_cannot_be_changed(variant: Variant, message: str) -> None:
    with pytest.raises(ExplainedError, match=message):
        variant.check()


def test_every_method_can_be_measured_as_it_is() -> None:
    assert [one.method for one in variants(tuple(PRESET_OF_METHOD))] == [*PRESET_OF_METHOD]
    variants(("dfrf-paper", "dfrf-nocrops", "dfrf", "paper"), warp=False)
    with pytest.raises(ExplainedError, match="there is dfrf, "):
        preset_of("quick")
