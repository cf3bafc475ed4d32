"""What a person's lips make of what is said."""

from dataclasses import replace

import torch
from torch import Tensor

from dfrf import presets
from dfrf.data import neighbour_windows
from dfrf.fast.model import FastModel
from dfrf.field.conditioning import REACH
from dfrf.training.lip_supervision import dataset_codes, train_speech_networks
from dfrf.training.speaker_adaptation import fit_speaker_adaptation, padded_neighbours
from tests.dfrf.people import small_config
from tests.dfrf.training.test_lip_supervision import talking


def read_off(model: FastModel, windows: Tensor, segment: Tensor) -> Tensor:
    """Lips (C, K) that the codes of a speaking person say."""
    count = len(windows)
    number = torch.arange(-REACH, count + REACH).clamp(0, count - 1)
    conditioning = model.field.conditioning(
        neighbour_windows(windows, segment, number), torch.zeros(count, 6)
    )
    with torch.no_grad():
        return model.field.conditioning.lips(conditioning[:, :-6])


def agreement(one: Tensor, other: Tensor) -> list[float]:
    """Correlation of each column."""
    return [
        float(torch.corrcoef(torch.stack(pair))[0, 1]) for pair in zip(one.T, other.T, strict=True)
    ]


def test_neighbours_stand_beside_a_frame_and_the_ends_go_on() -> None:
    said = torch.arange(10.0).view(5, 2)
    near = padded_neighbours(said)
    assert near.shape == (5, 2 * (2 * REACH + 1))
    for frame in range(5):
        expected = [said[min(max(frame + k, 0), 4)] for k in range(-REACH, REACH + 1)]
        assert torch.equal(near[frame], torch.cat(expected))


def test_without_adaptation_codes_say_what_is_heard() -> None:
    model, someone = presets.build(small_config()), talking(0)
    heard = model.field.conditioning.lips(dataset_codes(model.field.conditioning, someone))
    said = read_off(model, someone.windows, someone.segment)
    torch.testing.assert_close(said, heard, atol=1e-4, rtol=1e-4)


def test_a_person_who_answers_a_frame_late_and_mixes_measures_is_learned() -> None:
    model, someone = presets.build(small_config()), talking(0, frames=240)
    train_speech_networks(
        model.field.conditioning, [someone], 100, torch.Generator().manual_seed(0)
    )
    with torch.no_grad():
        heard = model.field.conditioning.lips(dataset_codes(model.field.conditioning, someone))
    late = heard.roll(2, 0) @ torch.randn(7, 7, generator=torch.Generator().manual_seed(3))
    lips = (late - late.mean(0)) / late.std(0)
    learned = replace(
        someone, lips=lips[:150], windows=someone.windows[:150], segment=someone.segment[:150]
    )
    before = agreement(heard[150:], lips[150:])
    fit_speaker_adaptation(model.field.conditioning, learned)
    said = read_off(model, someone.windows, someone.segment)
    after = agreement(said[150:], lips[150:])
    assert min(after) > 0.5
    assert sum(before) < 0.6 * sum(after)
    # Mean and spread are those of what is said, as pictures were learned.
    torch.testing.assert_close(said[:150].mean(0), heard[:150].mean(0), atol=2e-2, rtol=0.1)
    torch.testing.assert_close(said[:150].std(0), heard[:150].std(0), atol=2e-2, rtol=0.1)
