import math

import torch
from torch import Tensor
from torch.autograd import gradcheck

from dfrf.published.volume_rendering import composite, opacities, transmittance


def slow_composite(
    colours: Tensor, alpha: Tensor, distances: Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Sample by sample, ray by ray."""
    weights = torch.zeros_like(alpha)
    colour, opacity, depth = [], [], []
    for r in range(alpha.shape[0]):
        light = 1.0
        total, covered, reached = torch.zeros(3, dtype=colours.dtype), 0.0, 0.0
        for s in range(alpha.shape[1]):
            w = light * alpha[r, s].item()
            weights[r, s] = w
            total = total + w * colours[r, s]
            covered += w
            reached += w * distances[r, s].item()
            light *= 1 - alpha[r, s].item()
        colour.append(total)
        opacity.append(covered)
        depth.append(reached)
    return (
        weights,
        torch.stack(colour),
        torch.tensor(opacity, dtype=alpha.dtype),
        torch.tensor(depth, dtype=alpha.dtype),
    )


def test_against_a_loop() -> None:
    alpha = torch.rand(5, 7, dtype=torch.float64)
    alpha[0, 2], alpha[1] = 1.0, 0.0
    colours = torch.rand(5, 7, 3, dtype=torch.float64)
    distances = torch.rand(5, 7, dtype=torch.float64).cumsum(-1)
    seen = composite(colours, alpha, distances)
    weights, colour, opacity, depth = slow_composite(colours, alpha, distances)
    torch.testing.assert_close(seen.weights, weights)
    torch.testing.assert_close(seen.colour, colour)
    torch.testing.assert_close(seen.opacity, opacity)
    torch.testing.assert_close(seen.depth, depth)


def test_two_half_opaque_samples_by_hand() -> None:
    colours = torch.tensor([[1.0, 0, 0], [0, 1, 0]])
    seen = composite(colours, torch.tensor([0.5, 0.5]), torch.tensor([2.0, 4.0]))
    assert seen.weights.tolist() == [0.5, 0.25]
    assert seen.colour.tolist() == [0.5, 0.25, 0]
    assert seen.opacity.item() == 0.75
    assert seen.depth.item() == 2.0
    # A quarter of the blue background is left.
    assert seen.over(torch.tensor([0.0, 0, 1])).tolist() == [0.5, 0.25, 0.25]


def test_the_background_as_an_opaque_last_sample_gives_the_same_colour() -> None:
    alpha, colours, behind = torch.rand(4, 6), torch.rand(4, 6, 3), torch.rand(4, 3)
    apart = composite(colours, alpha, alpha).over(behind)
    alpha = torch.cat([alpha, torch.ones(4, 1)], -1)
    colours = torch.cat([colours, behind[:, None]], 1)
    torch.testing.assert_close(apart, composite(colours, alpha, alpha).colour)


def test_padding_changes_nothing() -> None:
    alpha, colours, t = torch.rand(3, 4), torch.rand(3, 4, 3), torch.rand(3, 4)
    plain = composite(colours, alpha, t)
    slots = [0, 2, 3, 6]
    padded = [torch.full((3, 8, *x.shape[2:]), 9.0) for x in (colours, alpha, t)]
    padded[1].zero_()
    for target, values in zip(padded, (colours, alpha, t), strict=True):
        target[:, slots] = values
    seen = composite(*padded)
    torch.testing.assert_close(seen.colour, plain.colour)
    torch.testing.assert_close(seen.opacity, plain.opacity)
    torch.testing.assert_close(seen.depth, plain.depth)
    torch.testing.assert_close(seen.weights[:, slots], plain.weights)


def test_constant_density_follows_the_law_of_absorption() -> None:
    alpha = opacities(torch.full((1, 50), 0.04))
    assert math.isclose(
        composite(torch.zeros(1, 50, 3), alpha, alpha).opacity.item(),
        1 - math.exp(-2),
        abs_tol=1e-6,
    )
    torch.testing.assert_close(transmittance(alpha)[0], torch.exp(-0.04 * torch.arange(50)))


def test_nothing_is_lost_from_thin_samples() -> None:
    assert opacities(torch.tensor(1e-12)).item() > 9e-13


def test_gradient() -> None:
    colours = torch.rand(2, 5, 3, dtype=torch.float64, requires_grad=True)
    thickness = torch.rand(2, 5, dtype=torch.float64, requires_grad=True)
    t = torch.rand(2, 5, dtype=torch.float64)

    def render(c: Tensor, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        seen = composite(c, opacities(x), t)
        return seen.colour, seen.opacity, seen.depth

    assert gradcheck(render, (colours, thickness))


def test_gradient_behind_an_opaque_sample_is_finite() -> None:
    alpha = torch.tensor([[0.2, 1.0, 0.3]], requires_grad=True)
    composite(torch.rand(1, 3, 3), alpha, alpha.detach()).colour.sum().backward()
    assert alpha.grad is not None
    assert alpha.grad.isfinite().all()
    assert alpha.grad[0, 2] == 0
