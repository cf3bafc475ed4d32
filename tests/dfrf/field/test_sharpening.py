"""A head that is sharpened inside, and left alone at its edge."""

from __future__ import annotations

import torch

from dfrf.field.sharpening import HEAD_SPREAD, unsharp
from dfrf.metrics.image import gradient_energy


def test_a_ripple_is_higher_by_as_much_as_the_kernel_says() -> None:
    wave = 0.5 + 0.2 * torch.sin(torch.arange(32) * torch.pi / 2)
    colour = wave[None, :, None].expand(32, 32, 3)
    sharp = unsharp(colour, torch.ones(32, 32))
    # Of a wave four pixels long the kernel (-s/2, 1 + s, -s/2) makes one 1 + s times as high.
    inner = (slice(2, -2), slice(2, -2))
    torch.testing.assert_close(sharp[inner] - 0.5, (1 + HEAD_SPREAD) * (colour[inner] - 0.5))
    assert gradient_energy(sharp) > 1.2 * gradient_energy(colour)


def test_an_even_colour_and_a_soft_edge_stay_as_they_are() -> None:
    opacity = torch.linspace(0, 1, 32).expand(32, 32).clone()
    opacity[:, 20:] = 1
    colour = opacity[..., None] * torch.tensor([0.8, 0.5, 0.4])
    changed = (unsharp(colour, opacity) - colour).abs().amax((0, 2))
    assert changed[21:].max() < 1e-6
    assert changed[:8].max() < 0.01
    nothing = torch.zeros(32, 32)
    assert unsharp(torch.zeros(32, 32, 3), nothing).equal(torch.zeros(32, 32, 3))
