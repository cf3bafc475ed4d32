"""Regularizers of the density, beside slow sums and numbers by hand."""

from __future__ import annotations

import torch

from dfrf.fast.fast_loss import distortion_loss, surface_loss


def test_distortion_is_the_double_sum() -> None:
    """Equation 15 of mip-NeRF 360, pair by pair; a slot without weight may lie anywhere."""
    weights = torch.tensor([[0.2, 0.5, 0.1, 0.0], [0.9, 0.0, 0.0, 0.0]])
    distances = torch.tensor([[1.0, 1.2, 1.9, 0.0], [3.0, 0.0, 0.0, 0.0]])
    step, rays = 0.1, []
    for w, t in zip(weights.tolist(), distances.tolist(), strict=True):
        pairs = list(zip(w, t, strict=True))
        between = sum(a * b * abs(x - y) for a, x in pairs for b, y in pairs)
        rays.append(between + sum(a * a for a in w) * step / 3)
    found = distortion_loss(weights, distances, step)
    torch.testing.assert_close(found, torch.tensor(sum(rays) / 2))


def test_a_surface_on_the_mean_face_costs_nothing() -> None:
    distance, opaque = torch.tensor([5.0, 6.0]), torch.ones(2)
    assert surface_loss(distance, opaque, distance) == 0
    before = surface_loss(distance - 0.1, opaque, distance)
    torch.testing.assert_close(before, torch.tensor(0.1))
    torch.testing.assert_close(surface_loss(distance + 0.1, opaque, distance), before)
    assert surface_loss(distance + 3, opaque, distance) == 0.5


def test_light_that_passes_counts_as_a_surface_behind_the_face() -> None:
    distance, half = torch.tensor([5.0]), torch.tensor([0.5])
    found = surface_loss(half * distance, half, distance, margin=0.2)
    torch.testing.assert_close(found, torch.tensor(0.1))
    # With half of its light before the face, it lies in the mean where the face is.
    there = surface_loss(half * (distance - 0.2), half, distance, margin=0.2)
    torch.testing.assert_close(there, torch.tensor(0.0), atol=1e-6, rtol=0)
