"""The loss of a step: each of its terms is in it, with its weight."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
import torch
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.fast.fast_loss import distortion_loss, matte_loss, share_loss, surface_loss
from dfrf.fast.fast_model import FastModel
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.volume_rendering import RayColours, render_rays
from dfrf.training.ray_share import RayShare, draw_shares
from dfrf.training.warp_penalty import weighted_warp_penalty
from tests.dfrf.people import person, random_model

WEIGHTS = ("opacity_weight", "warp_weight", "distortion_weight", "depth_weight")
CONFIG = replace(TrainConfig(rays=128, frames=2), **dict.fromkeys(WEIGHTS, 0.0))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Drawn:
    """A model whose warp moves what it reads, and rays to learn from."""

    model: FastModel
    maps: ReferenceMaps
    share: RayShare

    def loss(self, *, warp: bool = True, **weights: float) -> tuple[float, float, RayColours]:
        """Loss and squared error under some weights, and what the rays see."""
        config = replace(CONFIG, **weights)  # type: ignore[arg-type]
        loss, mse, seen = share_loss(self.model, self.share, self.maps, config, warp)
        return loss.item(), mse.item(), seen

    def term(self, name: str, seen: RayColours) -> Tensor:
        """The term that a weight multiplies."""
        share, model = self.share, self.model
        if name == "opacity_weight":
            return matte_loss(seen.opacity, share.batch.matte)
        if name == "warp_weight":
            return weighted_warp_penalty(seen.offset, seen.alpha)
        if name == "distortion_weight":
            return distortion_loss(seen.weights, seen.distances, model.config.march.step)
        volume = model.volume(share.conditioning, self.maps, True, share.batch.frames)
        face = render_rays(volume, share.surface.rays)
        return surface_loss(face.depth, face.opacity, share.surface.distance)


@pytest.fixture
def drawn() -> Drawn:
    model, maps = random_model()
    with torch.no_grad():
        for parameter in model.field.warp.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    generator = torch.Generator().manual_seed(0)
    known = torch.randn(6, model.config.field.cond_dim, generator=generator)
    (share,) = draw_shares(person(), known, CONFIG, generator, 1)
    return Drawn(model, maps, share)


@pytest.mark.parametrize("name", WEIGHTS)
def test_a_term_counts_with_its_weight(drawn: Drawn, name: str) -> None:
    loss, mse, seen = drawn.loss(**{name: 0.7})  # type: ignore[arg-type]
    term = drawn.term(name, seen).item()
    assert 0.7 * term > 0.01 * mse
    assert loss - mse == pytest.approx(0.7 * term, rel=1e-3)


def test_without_weights_the_error_of_the_colours_is_left(drawn: Drawn) -> None:
    loss, mse, seen = drawn.loss()
    share = drawn.share.batch
    over = seen.colour.detach() + (1 - seen.opacity.detach()[:, None]) * share.background
    assert loss == mse == pytest.approx(float((over - share.colour).square().mean()))


def test_the_coarse_stage_has_no_warp_to_punish(drawn: Drawn) -> None:
    loss, mse, _ = drawn.loss(warp=False, warp_weight=0.7)
    assert loss == mse


def test_by_default_every_term_counts() -> None:
    assert all(getattr(TrainConfig(), name) > 0 for name in WEIGHTS)
