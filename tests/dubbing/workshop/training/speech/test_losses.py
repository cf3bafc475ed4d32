"""What is not known counts for nothing."""

import torch

from dubbing.speech.acoustic_network import PHONES, AcousticNetwork
from dubbing.workshop.training.speech.losses import losses


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
