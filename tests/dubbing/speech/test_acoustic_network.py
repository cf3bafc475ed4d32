"""The network: its size, and what its losses count."""

import torch

from dubbing.speech.acoustic_network import LIPS, PHONES, AcousticNetwork, losses
from dubbing.speech.phone_classes import CLASSES
from dubbing.workshop.synthetic.visemes import CHANNELS


def test_it_is_small() -> None:
    assert sum(p.numel() for p in AcousticNetwork().parameters()) <= 1_500_000


def test_its_heads_fit_what_it_is_taught() -> None:
    assert (len(CLASSES), len(CHANNELS)) == (PHONES, LIPS)


def targets(batch: int = 2, count: int = 20) -> list[torch.Tensor]:
    senones = torch.nn.functional.one_hot(torch.randint(126, (batch, count)), 126).float()
    phones = torch.randint(PHONES, (batch, count))
    return [senones, phones, torch.rand(batch, count, 7), torch.ones(batch, count)]


def test_filling_counts_for_nothing() -> None:
    torch.manual_seed(0)
    network = AcousticNetwork().eval()
    heard = network(torch.randn(2, 20, 128))
    senones, phones, lips, known = targets()
    known[:, 12:] = 0
    before = losses(heard, senones, phones, lips, known)
    senones[:, 12:], phones[:, 12:], lips[:, 12:] = 0, 3, 9.0
    assert losses(heard, senones, phones, lips, known) == before


def test_unknown_phones_and_lips_count_for_nothing() -> None:
    network = AcousticNetwork().eval()
    heard = network(torch.randn(2, 20, 128))
    senones, phones, lips, known = targets()
    phones[:], lips[:] = -1, torch.nan
    teacher, named, shaped = losses(heard, senones, phones, lips, known)
    assert teacher > 0
    assert named == 0
    assert shaped == 0
    (teacher + named + shaped).backward()
    assert all(p.grad is not None and p.grad.isfinite().all() for p in network.gru.parameters())


def test_later_sound_changes_what_was_heard_before() -> None:
    """It listens both ways."""
    network = AcousticNetwork().eval()
    sound = torch.randn(1, 40, 128)
    other = sound.clone()
    other[:, 25:] = 0
    assert (network(sound).hidden - network(other).hidden)[:, :20].abs().max() > 1e-4
