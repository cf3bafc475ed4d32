"""The lip filter learns lips that follow the sound, and those of people it never saw."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from dfrf.field.speaker_adaptation import TOUCHING
from dubbing.sound_to_lips.lip_network import LipFilter
from dubbing.speech.voice_activity import SAMPLE_RATE
from dubbing.workshop.training.lips.lip_clips import LipClip, at_speed, degraded
from dubbing.workshop.training.lips.training import at_moments, fit, principal_components
from tests.dubbing.workshop.training.lips.made import lip_clip

pytestmark = pytest.mark.medium


def agreement(learned: LipFilter, one: LipClip) -> tuple[float, float]:
    """Correlation of the opening, and of the score with touching lips."""
    take = one.takes[0]
    with torch.no_grad():
        answers = learned(take.encoded.float())
    found = at_moments(answers, take.moments(one.times)).numpy()
    opening = np.corrcoef(found[:, 0], one.lips[:, 0])[0, 1]
    return float(opening), float(np.corrcoef(found[:, TOUCHING], one.closed)[0, 1])


def test_the_filter_carries_to_a_stranger_and_nothing_learned_does_not() -> None:
    stranger = lip_clip(9)
    torch.manual_seed(0)
    assert abs(agreement(LipFilter(), stranger)[0]) < 0.5
    opening, touching = agreement(fit([lip_clip(k) for k in range(12)]), stranger)
    assert opening > 0.8
    assert touching > 0.5


def test_answers_have_mean_0_over_what_was_learned() -> None:
    people = [lip_clip(k) for k in range(3)]
    learned = fit(people)
    with torch.no_grad():
        answers = torch.cat([learned(one.takes[0].encoded.float()) for one in people])
    assert answers.mean(0).abs().max() < 0.05


def test_what_is_heard_varies_by_1_and_in_the_largest_directions_first() -> None:
    generator = torch.Generator().manual_seed(0)
    hidden = torch.randn(4000, 2, generator=generator)
    mixing = torch.randn(2, 6, generator=generator)
    sounds = 3 + 5 * hidden @ mixing + 0.1 * torch.randn(4000, 6, generator=generator)
    directions = principal_components(sounds, 2)
    heard = (sounds - sounds.mean(0)) @ directions.T
    torch.testing.assert_close(heard.T @ heard / len(heard), torch.eye(2), atol=0.01, rtol=0)
    # Both hidden numbers are read off what is heard.
    solved = torch.linalg.lstsq(heard, hidden - hidden.mean(0))
    assert (hidden - hidden.mean(0) - heard @ solved.solution).std() < 0.05


def test_a_second_take_of_the_same_sound_changes_nothing() -> None:
    people = [lip_clip(k) for k in range(3)]
    twice = [replace(one, takes=one.takes * 2) for one in people]
    one, other = fit(people).map.weight, fit(twice).map.weight
    assert torch.allclose(one, other, atol=1e-4)


def test_values_are_read_between_steps() -> None:
    values = torch.arange(10.0).view(10, 1)
    moments = np.array([0.25, 3.5, 8.0])
    np.testing.assert_allclose(at_moments(values, moments)[:, 0], moments)


def test_a_faster_take_lies_earlier() -> None:
    take = replace(lip_clip(0).takes[0], speed=1.25)
    np.testing.assert_allclose(take.moments(np.array([1.0])), [SAMPLE_RATE / 384 / 1.25 - 0.5])
    assert len(at_speed(np.zeros(16000, np.float32), 1.25)) == 12800


def test_a_spoilt_sound_has_the_same_length_and_is_another() -> None:
    rng = np.random.default_rng(0)
    clean = np.sin(np.arange(16000) / 9).astype(np.float32)
    made = degraded(clean, rng)
    assert made.shape == clean.shape
    assert np.isfinite(made).all()
    assert np.abs(made - clean).max() > 1e-3


def test_nothing_to_learn_from_is_refused() -> None:
    with pytest.raises(ValueError, match="no clip"):
        fit([])
