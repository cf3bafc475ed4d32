import math

import torch
from torch.autograd import gradcheck

from dfrf.training.warp_penalty import warp_length, weighted_warp_penalty

# Two references, three points: lengths 5, 0, 1 and 13, 2, 0.
OFFSETS = torch.tensor(
    [[[3.0, 4.0], [0.0, 0.0], [0.0, -1.0]], [[-5.0, 12.0], [2.0, 0.0], [0.0, 0.0]]]
)


def test_equation_5_by_hand() -> None:
    assert warp_length(OFFSETS).tolist() == [9.0, 1.0, 0.5]
    assert math.isclose(warp_length(OFFSETS).mean().item(), (5 + 0 + 1 + 13 + 2 + 0) / 6)


def test_equation_6_by_hand() -> None:
    opacity = torch.tensor([0.9, 0.5, 0.0])
    expected = (0.1 * 9 + 0.5 * 1 + 1.0 * 0.5) / 3
    assert math.isclose(weighted_warp_penalty(OFFSETS, opacity).item(), expected, rel_tol=1e-6)


def test_extremes_of_the_weight() -> None:
    assert weighted_warp_penalty(OFFSETS, torch.ones(3)) == 0
    assert weighted_warp_penalty(OFFSETS, torch.zeros(3)) == warp_length(OFFSETS).mean()


def test_points_may_have_any_shape() -> None:
    offsets, opacity = torch.randn(4, 2, 5, 2), torch.rand(2, 5)
    flat = weighted_warp_penalty(offsets.flatten(1, 2), opacity.flatten())
    torch.testing.assert_close(weighted_warp_penalty(offsets, opacity), flat)


def test_gradient_of_the_length_is_its_direction_and_zero_at_zero() -> None:
    offsets = OFFSETS.clone().requires_grad_()
    warp_length(offsets).mean().backward()
    assert offsets.grad is not None
    torch.testing.assert_close(offsets.grad[0, 0] * 6, torch.tensor([0.6, 0.8]))
    assert offsets.grad[0, 1].tolist() == [0, 0]
    smooth = (torch.rand(2, 3, 2, dtype=torch.float64) + 0.5).requires_grad_()
    opacity = torch.rand(3, dtype=torch.float64)
    assert gradcheck(lambda o: weighted_warp_penalty(o, opacity), smooth)


def test_opacity_is_a_weight_and_is_not_taught() -> None:
    opacity = torch.rand(3, requires_grad=True)
    loss = weighted_warp_penalty(OFFSETS.clone().requires_grad_(), opacity)
    loss.backward()
    assert opacity.grad is None
