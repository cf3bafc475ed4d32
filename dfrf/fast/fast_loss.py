"""The loss of the `fast` model: equation (9), and terms that keep its density compact."""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.fast.fast_model import FastModel
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.method_interface import StepOutcome
from dfrf.rendering.ray_marching import Search
from dfrf.rendering.volume_rendering import RayColours, render_rays
from dfrf.training.ray_share import RayShare
from dfrf.training.regularizers import distortion_loss, matte_loss, surface_loss
from dfrf.training.warp_penalty import weighted_warp_penalty


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
