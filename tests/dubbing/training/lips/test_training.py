"""The lip network learns lips that follow the sound, and those of people it never saw."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from dubbing.sound_to_lips.network import CLOSED, LipNetwork
from dubbing.sound_to_lips.predict import lips_of
from dubbing.speech.voice_activity import at_times
from dubbing.training.lips.closed_form import at_moments, fit_filters
from dubbing.training.lips.lessons import Lesson, at_speed, outlined, spoilt
from dubbing.training.lips.training import LipTraining, balance, draw, loss_of, read, train_member
from tests.dubbing.training.lips.made import lesson, network


def said(learned: LipNetwork, one: Lesson) -> np.ndarray:
    take = one.takes[0]
    found = lips_of(learned, take.activations.float().numpy(), take.voice.float().numpy())
    return at_times(found.table(), one.times)


def agreement(learned: LipNetwork, one: Lesson) -> tuple[float, float]:
    """Correlation of the opening, and of the score with touching lips."""
    found = said(learned, one)
    opening = np.corrcoef(found[:, 0], one.lips[:, 0])[0, 1]
    return float(opening), float(np.corrcoef(found[:, CLOSED], one.closed)[0, 1])


def test_filters_carry_to_a_stranger_and_nothing_learned_does_not() -> None:
    people, stranger, net = [lesson(k) for k in range(4)], lesson(9), network()
    with torch.no_grad():
        net.scale[2:] = 0
    assert abs(agreement(net, stranger)[0]) < 0.5
    fit_filters(net, people)
    opening, touching = agreement(net, stranger)
    assert opening > 0.8
    assert touching > 0.5


def test_a_member_carries_to_a_stranger() -> None:
    people, stranger, net = [lesson(k) for k in range(4)], lesson(9), network()
    with torch.no_grad():
        net.scale[:2] = 0
        activations = [
            [net.inputs(t.activations.float(), t.voice.float())[2] for t in one.takes]
            for one in people
        ]
    settings = LipTraining(iterations=60, items=8, rate=5e-3)
    train_member(net.members[0], people, activations, settings)  # type: ignore[arg-type]
    opening, touching = agreement(net, stranger)
    assert opening > 0.6
    assert touching > 0.3
    balance(net, people)
    assert torch.isfinite(net.scale).all()


def test_the_same_seed_draws_the_same() -> None:
    people = [lesson(k) for k in range(2)]
    activations = [[t.activations.float()[:, :64] for t in one.takes] for one in people]
    one, other = (draw(people, activations, 4, np.random.default_rng(3)) for _ in range(2))
    assert torch.equal(one.features, other.features)
    assert torch.equal(one.targets, other.targets)


def test_the_loss_is_least_where_lips_are_right() -> None:
    people = [lesson(k) for k in range(2)]
    activations = [[t.activations.float()[:, :64] for t in one.takes] for one in people]
    batch = draw(people, activations, 4, np.random.default_rng(3))
    right = batch.targets.clone()
    right[..., CLOSED] = 20 * (right[..., CLOSED] - 0.5)
    still = torch.zeros_like(right)
    assert loss_of(right, batch) < 0.05
    assert loss_of(still, batch) > 1


def test_answers_are_read_between_steps() -> None:
    answers = torch.arange(10.0).view(1, 10, 1)
    moments = torch.tensor([[0.25, 3.5, 8.0]])
    assert torch.allclose(read(answers, moments)[0, :, 0], moments[0])
    assert torch.allclose(at_moments(answers[0], moments[0].numpy())[:, 0], moments[0])


def test_a_faster_take_lies_earlier() -> None:
    take = replace(lesson(0).takes[0], speed=1.25)
    np.testing.assert_allclose(take.moments(np.array([1.0])), [50 / 1.25 - 0.5])
    assert len(at_speed(np.zeros(16000, np.float32), 1.25)) == 12800


def test_a_spoilt_sound_has_the_same_length_and_is_another() -> None:
    rng = np.random.default_rng(0)
    clean = np.sin(np.arange(16000) / 9).astype(np.float32)
    made = spoilt(clean, rng)
    assert made.shape == clean.shape
    assert np.isfinite(made).all()
    assert np.abs(made - clean).max() > 1e-3


def test_outlines_are_told_by_a_few_numbers() -> None:
    people = [
        replace(lesson(k), outline=np.random.default_rng(k).random((150, 80))) for k in (0, 1)
    ]
    for one in outlined(people):
        assert one.outline.shape == (150, 8)
        np.testing.assert_allclose(one.outline.std(0), 1, atol=1e-3)


def test_nothing_to_learn_from_is_refused() -> None:
    with pytest.raises(ValueError, match="no lesson"):
        fit_filters(network(), [])
