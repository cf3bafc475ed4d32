"""The strength of a person's lips, and lips that are given in their place."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import Tensor

from dfrf import presets
from dfrf.field.conditioning import Conditioning
from dfrf.field.speaker_adaptation import (
    CONTEXT_FRAMES,
    LIP_MEASURES,
    NUMBERS,
    OPENING,
    OWN,
    with_closures,
)
from tests.dfrf.people import small_config

FRAMES = 12
WIDER = 3.0  # times the predicted lips: what the person's own are
EXPRESSION = torch.zeros(FRAMES, 6)
ONE = torch.ones(FRAMES)


@pytest.fixture(scope="module")
def person() -> Conditioning:
    """Somebody who opens the mouth wider than predicted; closed, it is far from all of that."""
    model = presets.build(small_config())
    own = model.field.conditioning
    assert isinstance(own, Conditioning)
    with torch.no_grad():
        own.speaker_adaptation.linear.weight[:, OWN] *= WIDER
        own.closed_mouth_target.copy_(torch.linspace(-4, -1, LIP_MEASURES))
    return own.eval()


@pytest.fixture(scope="module")
def speech() -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(0)
    predicted = torch.randn(FRAMES + 2 * CONTEXT_FRAMES, NUMBERS, generator=generator)
    return torch.rand(FRAMES, 8, 16, 8, generator=generator) + 0.1, predicted


@torch.no_grad()
def wanted(person: Conditioning, speech: tuple[Tensor, Tensor], strength: Tensor) -> Tensor:
    """Lip measures (FRAMES, L) that are read from the codes."""
    codes = person(*speech, EXPRESSION, strength)[:, : person.config.code_dim]
    lips: Tensor = person.lips(codes)
    return lips


@torch.no_grad()
def test_as_spoken_nothing_changes(person: Conditioning, speech: tuple[Tensor, Tensor]) -> None:
    codes = person.speech_codes(speech[0])
    open_, share = person.speaker_adaptation(speech[1])
    lips = with_closures(open_, share, person.closed_mouth_target)
    unedited = person.project_to_lips(codes, lips)
    assert torch.equal(person.adapted_codes(*speech), unedited)
    assert torch.equal(person(*speech, EXPRESSION, ONE), person(*speech, EXPRESSION))


@pytest.mark.parametrize("strength", [0.0, 0.4, 1.5, "each frame its own"])
def test_the_person_s_own_lips_leave_the_closed_mouth_by_so_much(
    person: Conditioning, speech: tuple[Tensor, Tensor], strength: float | str
) -> None:
    own_each = torch.linspace(0.1, 0.9, FRAMES)
    share = own_each if isinstance(strength, str) else torch.full((FRAMES,), strength)
    closed = person.closed_mouth_target
    own = WIDER * speech[1][CONTEXT_FRAMES:-CONTEXT_FRAMES, :LIP_MEASURES]
    expected = closed + share[:, None] * (own - closed)
    made = wanted(person, speech, share)
    torch.testing.assert_close(made, expected, atol=1e-3, rtol=1e-3)
    spoken, opens = wanted(person, speech, ONE)[:, OPENING], own[:, OPENING] > closed[OPENING]
    assert opens.sum() > 3
    assert bool((made[opens, OPENING] > spoken[opens]).all()) == bool((share > 1).all())


@torch.no_grad()
def test_a_muted_mouth_is_still_and_as_in_silence(
    person: Conditioning, speech: tuple[Tensor, Tensor]
) -> None:
    codes = person.adapted_codes(*speech, strength=torch.zeros(FRAMES))
    silent = person.adapted_codes(torch.zeros_like(speech[0]), speech[1])
    torch.testing.assert_close(codes, silent, atol=1e-4, rtol=1e-4)
    assert (codes - codes[0]).abs().max() < 1e-4
    assert person.adapted_codes(*speech).std(0).max() > 0.1


@pytest.mark.parametrize("changes", [{"lip_supervision": False}, {"use_speech": False}])
def test_a_model_without_lip_measures_refuses(
    speech: tuple[Tensor, Tensor], changes: dict[str, bool]
) -> None:
    own = presets.build(small_config(**changes)).field.conditioning
    assert isinstance(own, Conditioning)
    own(*speech, EXPRESSION)
    with pytest.raises(ValueError, match="without lip measures"):
        own(*speech, EXPRESSION, 0.5 * ONE)


@torch.no_grad()
def test_given_lips_take_the_place_of_the_person_s(
    person: Conditioning, speech: tuple[Tensor, Tensor]
) -> None:
    own = WIDER * speech[1][CONTEXT_FRAMES:-CONTEXT_FRAMES, :LIP_MEASURES]
    given = torch.full((FRAMES, LIP_MEASURES + 1), torch.nan)
    given[3:6, OPENING], expected = 2.0, own.clone()
    expected[3:6, OPENING] = 2.0
    codes = person.adapted_codes(*speech, given=given)
    torch.testing.assert_close(person.lips(codes), expected, atol=1e-3, rtol=1e-3)
    # The strength moves them, as it moves those that are heard.
    closed, half = person.closed_mouth_target, torch.full((FRAMES,), 0.5)
    moved = person.lips(person.adapted_codes(*speech, half, given))
    torch.testing.assert_close(moved, closed + 0.5 * (expected - closed), atol=1e-3, rtol=1e-3)
    # In silence the mouth is shut but where lips are given.
    silent = person.lips(person.adapted_codes(torch.zeros_like(speech[0]), speech[1], given=given))
    torch.testing.assert_close(silent[3:6, OPENING], given[3:6, OPENING], atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(silent[:3], closed.expand(3, -1), atol=1e-3, rtol=1e-3)


@torch.no_grad()
def test_a_given_closure_takes_the_place_of_the_one_that_is_heard(
    person: Conditioning, speech: tuple[Tensor, Tensor]
) -> None:
    closing = copy.deepcopy(person)
    closing.speaker_adaptation.score.copy_(torch.tensor([0.0, 0.0, 1.0]))  # lips are rather shut
    heard, share = closing.speaker_adaptation(speech[1])
    shut = closing.closed_mouth_target
    given = torch.full((FRAMES, LIP_MEASURES + 1), torch.nan)
    given[2:5, -1], given[4:8, OPENING] = torch.tensor([0.0, 0.4, 1.0]), 2.0
    open_ = heard.clone()
    open_[4, OPENING] = 2.0
    own = share.clone()
    own[2:5] = given[2:5, -1]
    expected = with_closures(open_, own, shut)
    expected[5:8, OPENING] = 2.0  # without a closure of its own, a length is as it is given
    made = closing.lips(closing.adapted_codes(*speech, given=given))
    torch.testing.assert_close(made, expected, atol=1e-3, rtol=1e-3)
    # What the lips are, given again, changes nothing.
    for of in (None, given):
        parted = closing.wanted_lips(*speech, of)
        again = closing.adapted_codes(*speech, given=parted)
        torch.testing.assert_close(again, closing.adapted_codes(*speech, given=of))
