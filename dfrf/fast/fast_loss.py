"""The loss of the `fast` model: equation (9), and terms that keep its density on a surface.

R rays, S slots a ray, nearest first.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.fast.fast_model import FastModel
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.method_interface import StepOutcome
from dfrf.rendering.ray_marching import Search
from dfrf.rendering.volume_rendering import RayColours, render_rays
from dfrf.training.ray_share import RayShare
from dfrf.training.warp_penalty import weighted_warp_penalty

UNSURE = 0.05  # a matte further than this from 0 and 1 is unsure


def matte_loss(opacity: Float[Tensor, " B"], matte: Float[Tensor, " B"]) -> Float[Tensor, ""]:
    """Mean squared difference of opacity and matte, 0..1, where the matte is sure.

    A soft edge of a matte is a guess. The background is known there, so the colours of the image
    determine the opacity.
    """
    sure = ((matte - 0.5).abs() > 0.5 - UNSURE).to(matte.dtype)
    return (sure * (opacity - matte) ** 2).mean()


def distortion_loss(
    weights: Float[Tensor, "R S"], distances: Float[Tensor, "R S"], step: float
) -> Float[Tensor, ""]:
    """Distortion of the weights along rays (mip-NeRF 360, equation 15), mean over rays.

    sum_ij w_i w_j |t_i - t_j| + 1/3 sum_i w_i^2 step, computed with running sums since the samples
    of a ray are in order.

    Args:
        weights, distances: a weight of 0 is padding, whatever its distance.
        step: length of a sample.
    """
    before = weights.cumsum(-1) - weights
    moment = (weights * distances).cumsum(-1) - weights * distances
    between = 2 * (weights * (distances * before - moment)).sum(-1)
    within = (weights**2).sum(-1) * step / 3
    return (between + within).mean()


def surface_loss(
    depth: Float[Tensor, " R"],
    opacity: Float[Tensor, " R"],
    distance: Float[Tensor, " R"],
    margin: float = 0.2,
) -> Float[Tensor, ""]:
    """Mean distance of the rendered surface from the mean face, clipped at half a unit.

    Args:
        depth: sum of w_i t_i.
        opacity: sum of w_i; light that passes counts as a surface `margin` behind the face.
        distance: of the face along the ray, head units.
    """
    gap = depth + (1 - opacity) * (distance + margin) - distance
    return torch.clamp(gap.abs(), max=0.5).mean()


def share_loss(
    model: FastModel, share: RayShare, maps: ReferenceMaps | None, config: TrainConfig, warp: bool
) -> tuple[Tensor, Tensor, RayColours]:
    """Loss and mean squared error over a share of a step's rays, and the rendered rays.

    Args:
        model: in training.
        share: rays and their conditioning.
        maps: references.
        config: weights of the loss.
        warp: False in the coarse stage.
    """
    batch = share.batch
    conditioning = share.conditioning
    if share.windows is not None:
        conditioning = model.field.conditioning.with_codes(conditioning, share.windows)
    training_frames = batch.frames.to(conditioning.device)
    volume = model.volume(conditioning, maps, warp, training_frames)
    rendered = render_rays(volume, batch.rays, Search(jitter=share.jitter))
    # Equation (9): L = MSE + lambda L_r'.
    mse = F.mse_loss(rendered.over(batch.background), batch.colour)
    loss = mse + config.opacity_weight * matte_loss(rendered.opacity, batch.matte)
    if warp and rendered.offset.numel():
        penalty = weighted_warp_penalty(rendered.offset, rendered.alpha)
        loss = loss + config.warp_weight * penalty
    loss = loss + config.distortion_weight * distortion_loss(
        rendered.weights, rendered.distances, model.config.march.step
    )
    if config.depth_weight:
        face = render_rays(volume, share.surface.rays)
        surface = surface_loss(face.depth, face.opacity, share.surface.distance)
        loss = loss + config.depth_weight * surface
    return loss, mse, rendered


def share_outcome(
    model: FastModel,
    share: RayShare,
    maps: ReferenceMaps | None,
    config: TrainConfig,
    warp: bool,
    wanted: Sequence[Tensor],
) -> StepOutcome:
    """The loss of `share_loss`, and its gradients for the tensors wanted."""
    loss, mse, rendered = share_loss(model, share, maps, config, warp)
    gradients = torch.autograd.grad(loss, list(wanted), allow_unused=True)
    samples = rendered.samples
    return StepOutcome(
        loss.detach(),
        mse.detach(),
        list(gradients),
        samples.points,
        rendered.weights.detach()[samples.ray, samples.slot],
        share.batch.frame.numel(),
    )
