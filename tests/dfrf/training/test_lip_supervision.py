"""The speech networks learn what the lips do; the field is conditioned on what these did."""

from dataclasses import replace

import pytest
import torch

from dfrf import presets
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset, neighbour_windows
from dfrf.fast.fast_method import FastMethod
from dfrf.field.speaker_adaptation import CONTEXT_FRAMES, NUMBERS, closed_mouth
from dfrf.training.fit import fit
from dfrf.training.lip_supervision import (
    REGRESSION_SHARE,
    dataset_codes,
    fit_speaker_adaptation,
    lip_targets,
    regression_input,
    scale_decoded_lips,
    supervised_codes,
    train_speech_networks,
)
from tests.dfrf.people import person, small_config

pytestmark = pytest.mark.medium


def talking(seed: int, frames: int = 60) -> HeadDataset:
    """Someone whose lips follow two features of the speech, and a third that is theirs alone."""
    someone = person(frames=frames, seed=seed)
    generator = torch.Generator().manual_seed(100 + seed)
    loud = someone.windows.mean(1)
    own = torch.randn(frames, 1, generator=generator)
    lips = torch.cat([loud[:, :2].repeat(1, 3), own], 1)
    return replace(someone, lips=(lips - lips.mean(0)) / lips.std(0))


def test_lip_measures_are_learned_from_the_sound_and_nothing_else_changes() -> None:
    people = [talking(0), talking(1)]
    model = presets.build(small_config())
    before = {n: p.clone() for n, p in model.named_parameters()}
    last = train_speech_networks(
        model.field.conditioning, people, 300, torch.Generator().manual_seed(0)
    )
    assert last < 0.5
    changed = {
        n.split(".")[2] for n, p in model.named_parameters() if not torch.equal(p, before[n])
    }
    assert changed == {"audio", "attention", "lips"}
    assert not any(p.requires_grad for p in model.field.conditioning.audio.parameters())


@pytest.mark.parametrize("taught", [True, False])
def test_without_lip_supervision_pictures_teach_the_speech_networks(taught: bool) -> None:
    someone, config = talking(0), small_config()
    field = replace(config.field, references=0, use_warp=False, lip_supervision=taught)
    model = presets.build(replace(config, field=field))
    method = FastMethod(model)
    before = {n: p.clone() for n, p in model.field.conditioning.named_parameters()}
    fit(method, [someone], TrainConfig(iterations=2, rays=96, frames=2, warmup=0))
    own = model.field.conditioning
    changed = {n.split(".")[0] for n, p in own.named_parameters() if not torch.equal(p, before[n])}
    assert changed == ({"lips"} if taught else {"audio", "attention"})  # lips: their unit alone
    method.finish(someone, None, seed=0)
    frames = torch.arange(4)
    near = neighbour_windows(someone.windows, someone.segment, frames)
    heard = own(near, someone.predicted_lips[: 4 + 2 * CONTEXT_FRAMES], someone.expression[:4])
    codes = heard[:, : field.code_dim]
    assert torch.allclose(codes, own.speech_codes(near)) != taught


def test_what_only_one_person_does_is_not_learned_from_the_others() -> None:
    people = [talking(seed) for seed in range(4)]
    for target, someone in zip(lip_targets(people), people, strict=True):
        said = (target.lips - (1 - REGRESSION_SHARE) * someone.lips) / REGRESSION_SHARE
        agreement = [
            float(torch.corrcoef(torch.stack([said[:, k], someone.lips[:, k]]))[0, 1])
            for k in (0, 1, 6)
        ]
        assert min(agreement[:2]) > 0.6
        assert abs(agreement[2]) < 0.45


def test_one_person_alone_keeps_their_own_lips() -> None:
    someone = talking(0)
    (target,) = lip_targets([someone])
    assert torch.equal(target.lips, someone.lips)


def test_the_regression_reads_of_a_frame_its_window_and_what_lies_beside_it() -> None:
    someone = person(frames=12)
    conditioning = regression_input(someone)
    assert conditioning.shape == (12, 10 * 8 + 1)
    window = someone.windows * 2 - 1
    own = torch.stack([window[6, 2 * k : 2 * k + 2].mean(0) for k in range(8)]).flatten()
    expected = torch.cat([own, window[2, :8].mean(0), window[9, 8:].mean(0), torch.ones(1)])
    torch.testing.assert_close(conditioning[6], expected)


def test_supervised_codes_say_what_the_lips_did_with_the_spread_of_what_is_heard() -> None:
    someone = talking(0)
    number = torch.tensor([3, 7, 20, 41, 42, 59])
    pictures = ("images", "backgrounds", "mattes", "regions", "c2w", "centres", "expression")
    kept = {name: getattr(someone, name)[number] for name in (*pictures, "lip_points")}
    someone = replace(someone, number=number, **kept)
    model = presets.build(small_config())
    train_speech_networks(model.field.conditioning, [someone], 50, torch.Generator().manual_seed(0))
    heard = model.field.conditioning.lips(dataset_codes(model.field.conditioning, someone))
    supervised = model.field.conditioning.lips(supervised_codes(model.field.conditioning, someone))
    expected = (heard.mean(0) + heard.std(0) * someone.lips)[someone.number]
    torch.testing.assert_close(supervised, expected, atol=1e-4, rtol=1e-4)
    # The shortest way: nothing but what the lips are read from has changed.
    moved = (
        supervised_codes(model.field.conditioning, someone)
        - dataset_codes(model.field.conditioning, someone)[someone.number]
    )
    rows = model.field.conditioning.lips.weight
    left = moved - moved @ torch.linalg.pinv(rows) @ rows
    assert moved.norm() > 0.1
    assert left.norm() < 1e-3 * moved.norm()


def test_a_person_s_decoded_lips_are_in_the_measured_ones_unit_and_no_code_changes() -> None:
    someone, model = talking(0), presets.build(small_config())
    own = model.field.conditioning
    train_speech_networks(own, [someone], 50, torch.Generator().manual_seed(0))
    assert own.lips(dataset_codes(own, someone)).std(0).min() < 0.9
    before = supervised_codes(own, someone)
    for _ in range(2):  # a run in two parts does it again
        scale_decoded_lips(own, someone)
    decoded = own.lips(dataset_codes(own, someone))
    torch.testing.assert_close(decoded.mean(0), torch.zeros(7), atol=1e-4, rtol=0)
    torch.testing.assert_close(decoded.std(0), torch.ones(7), atol=1e-4, rtol=0)
    torch.testing.assert_close(supervised_codes(own, someone), before, atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(own.lips(before), someone.lips[someone.number], atol=1e-3, rtol=0)
    fit_speaker_adaptation(own, someone)
    torch.testing.assert_close(own.closed_mouth_target, closed_mouth(someone.lips))


def test_different_sounds_have_different_codes_from_the_start() -> None:
    model = presets.build(small_config())
    windows = (torch.rand(32, 1, 1, 8) * 1.2).expand(32, 8, 16, 8)
    codes = model.field.conditioning.speech_codes(windows)
    assert codes.std(0).norm() > 0.3 * codes.mean(0).norm()


def test_the_mouth_is_shut_where_nothing_is_heard_and_only_there() -> None:
    someone = talking(0)
    model = presets.build(small_config())
    train_speech_networks(model.field.conditioning, [someone], 50, torch.Generator().manual_seed(0))
    closed = closed_mouth(someone.lips)
    model.field.conditioning.closed_mouth_target.copy_(closed)
    windows, predicted = torch.rand(3, 8, 16, 8) + 0.1, torch.randn(3 + 2 * CONTEXT_FRAMES, NUMBERS)
    windows[1] = 0  # silence
    windows[2, 4, 4:8] = 0  # speech ends within the middle half of the window
    conditioning = model.field.conditioning(windows, predicted, torch.zeros(3, 6))
    lips = predicted[CONTEXT_FRAMES:-CONTEXT_FRAMES, :7]
    read = model.field.conditioning.lips(conditioning[:, :-6])
    torch.testing.assert_close(read[0], lips[0], atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(read[1], closed, atol=1e-4, rtol=1e-4)
    half = (lips[2] + closed) / 2
    torch.testing.assert_close(read[2], half, atol=1e-4, rtol=1e-4)
