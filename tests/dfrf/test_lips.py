"""The speech networks learn what the lips do, and only they do."""

import torch

from dfrf import presets
from dfrf.lips import learn_lips, lip_loss
from tests.dfrf.people import person, small_config


def test_lip_measures_are_learned_from_the_sound() -> None:
    someone = person(frames=12)
    model = presets.build(small_config())
    before = {n: p.clone() for n, p in model.named_parameters()}
    generator = torch.Generator().manual_seed(0)
    first = float(lip_loss(model, someone, 64, generator))
    last = learn_lips(model, [someone], 150, generator)
    assert last < 0.6 * first
    changed = {
        n.split(".")[1] for n, p in model.named_parameters() if not torch.equal(p, before[n])
    }
    assert changed == {"audio", "attention", "lips"}


def test_different_sounds_have_different_codes_from_the_start() -> None:
    model = presets.build(small_config())
    windows = (torch.rand(32, 1, 1, 8) * 1.2).expand(32, 8, 16, 8)
    codes = model.field.speech_codes(windows)
    assert codes.std(0).norm() > 0.3 * codes.mean(0).norm()
