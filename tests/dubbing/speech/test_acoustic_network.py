"""The network: its size, and what it hears."""

import torch

from dubbing.speech.acoustic_network import LIPS, PHONES, AcousticNetwork
from dubbing.speech.phone_classes import CLASSES
from dubbing.workshop.synthetic.visemes import CHANNELS


def test_it_is_small() -> None:
    assert sum(p.numel() for p in AcousticNetwork().parameters()) <= 1_500_000


def test_its_heads_fit_what_it_is_taught() -> None:
    assert (len(CLASSES), len(CHANNELS)) == (PHONES, LIPS)


def test_later_sound_changes_what_was_heard_before() -> None:
    """It listens both ways."""
    network = AcousticNetwork().eval()
    sound = torch.randn(1, 40, 128)
    other = sound.clone()
    other[:, 25:] = 0
    assert (network(sound).hidden - network(other).hidden)[:, :20].abs().max() > 1e-4
