"""How many steps a fine-tune takes."""

from dfrf.config import STEPS
from dubbing.identity.finetune_settings import FRONT_STEPS, TURNED_STEPS, FinetuneSettings


def test_a_dub_needs_more_steps_of_a_head_that_turns() -> None:
    dub = FinetuneSettings()
    assert dub.steps(from_base=True) == FRONT_STEPS
    assert dub.steps(from_base=True, turned=True) == TURNED_STEPS > FRONT_STEPS


def test_a_person_without_a_base_learns_everything() -> None:
    assert FinetuneSettings().steps(from_base=False, turned=True) == STEPS["fast"]
    paper = FinetuneSettings(preset="paper")
    assert paper.steps(from_base=True) == STEPS["paper"]


def test_a_number_that_is_asked_for_holds() -> None:
    for preset in ("fast", "paper"):
        settings = FinetuneSettings(preset=preset, iterations=7)
        assert settings.steps(from_base=True, turned=True) == 7
