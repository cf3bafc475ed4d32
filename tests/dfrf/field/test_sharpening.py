"""References that are sharpened before they are read between their pixels."""

from __future__ import annotations

import torch

from dfrf.field.sharpening import BILINEAR_SPREAD, sharpened
from dfrf.metrics.image import gradient_energy


def test_a_ripple_is_higher_by_as_much_as_the_kernel_says() -> None:
    wave = 0.5 + 0.2 * torch.sin(torch.arange(32) * torch.pi / 2)
    colour = wave[None, None, :, None].expand(1, 32, 32, 3)
    sharp = sharpened(colour)
    # Of a wave four pixels long the kernel (-s/2, 1 + s, -s/2) makes one 1 + s times as high.
    inner = (0, slice(2, -2), slice(2, -2))
    torch.testing.assert_close(sharp[inner] - 0.5, (1 + BILINEAR_SPREAD) * (colour[inner] - 0.5))
    assert gradient_energy(sharp[0]) > 1.2 * gradient_energy(colour[0])


def test_an_even_colour_stays_as_it_is_up_to_the_border() -> None:
    even = torch.tensor([0.8, 0.5, 0.4]).expand(1, 8, 8, 3)
    torch.testing.assert_close(sharpened(even), even)
