"""Presets: what they leave out, and that all of `fast`'s family start from its base."""

from dataclasses import replace

import pytest

from dfrf import presets
from dfrf.config import FROM_BASE, ModelConfig
from dfrf.published.paper_model import PaperModel
from dfrf.training.fit import learning_rate, make_optimiser
from tests.dfrf.people import small_config


def fast(preset: str) -> ModelConfig:
    config = presets.model_config(preset, 8)
    assert isinstance(config, ModelConfig)
    return config


@pytest.mark.parametrize("count", [1, 4, 6])
def test_numbers_of_references(count: int) -> None:
    config = presets.model_config("fast", 8, references=count)
    assert isinstance(config, ModelConfig)
    assert config.field.references == config.field.reference_pool_size == count
    with pytest.raises(ValueError, match="paper"):
        presets.model_config("paper", 8, references=count)
    with pytest.raises(ValueError, match="'nerf' has no references"):
        presets.model_config("nerf", 8, references=count)


@pytest.mark.parametrize("preset", ["fast", "fast-paper", "fast-nocrops"])
def test_the_warp_can_be_left_out(preset: str) -> None:
    field = fast(preset).field
    without = presets.model_config(preset, 8, warp=False)
    assert isinstance(without, ModelConfig)
    assert without.field == replace(field, use_warp=False) != field


def test_the_paper_learns_its_speech_from_pictures_and_starts_from_no_base_that_did_not() -> None:
    taught, paper = presets.build(fast("fast")), fast("fast-paper")
    with pytest.raises(
        ValueError, match="its speech networks learned from lips, not from pictures"
    ):
        presets.adapt(taught, paper)
    own = presets.build(paper)
    heard = own.field.conditioning.audio.state_dict()
    again = presets.adapt(own, paper).field.conditioning.audio.state_dict()
    assert all(value.equal(again[name]) for name, value in heard.items())
    assert "fast-paper" not in FROM_BASE


def test_a_person_has_more_references_than_are_looked_at() -> None:
    field = fast("fast").field
    assert 0 < field.references < field.reference_pool_size


def test_everything_that_a_base_serves_takes_all_it_has() -> None:
    base = presets.build(fast("fast"))
    for preset in FROM_BASE:
        model = presets.adapt(base, fast(preset))
        known = base.state_dict()
        for name, value in model.state_dict().items():
            assert value.equal(known[name]), name
    assert "fast-alone" not in FROM_BASE


def test_a_base_of_other_sizes_is_refused() -> None:
    base = presets.build(small_config(speech_dim=8))
    with pytest.raises(ValueError, match=r"the base has other sizes: .* is \(\d"):
        presets.adapt(base, small_config(speech_dim=8, width=24))


def test_an_unknown_preset() -> None:
    with pytest.raises(ValueError, match="fast-nocrops"):
        presets.model_config("quick", 8)


def test_paper_is_trained_as_the_published_code_trains() -> None:
    """The numbers are those of its optimisers and of its argument parser."""
    base, person = (presets.trainings("paper").base, presets.trainings("paper").finetune)
    assert learning_rate(0, base) == 5e-4
    assert learning_rate(300_000, base) == pytest.approx(1.99e-4, rel=2e-3)
    assert learning_rate(0, person) == pytest.approx(1.46e-4, rel=3e-3)
    assert learning_rate(40_000, person) == pytest.approx(1.30e-4, rel=5e-3)
    for training in (base, person):
        assert (training.rays, training.outside_share, training.adam.longest) == (850, 0.05, 0)
    model = presets.build(presets.model_config("paper", 29))
    assert isinstance(model, PaperModel)
    optimiser = make_optimiser(presets.method_of(model), base)
    both = optimiser.param_groups
    assert [group["betas"] for group in both] == [(0.9, 0.999)] * 2
    assert {group["eps"] for group in both} == {1e-8}
    attention = {id(p) for p in model.smoothing.parameters()}
    assert {group["rate"]: {id(p) in attention for p in group["params"]} for group in both} == {
        1.0: {False},
        5.0: {True},
    }
