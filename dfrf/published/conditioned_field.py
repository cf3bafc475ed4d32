"""The field of the `paper` preset: equations (1) to (7) as the published code assembles them.

R rays of one frame, S samples a ray, M points, N references of H x W pixels, D speech features.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.cameras import project
from dfrf.field.encodings import DIRECTION_OCTAVES, POINT_OCTAVES, encoded_size, frequency_encoding
from dfrf.published.radiance_field import RadianceMLP
from dfrf.published.references import ReferenceCNN, bilinear, clamp_to_image, nearest
from dfrf.published.slot_attention import TOKEN_EXTRA, SlotAttention
from dfrf.published.warp import MAX_OFFSET, WarpMLP


@dataclass(frozen=True)
class PaperConfig:
    """Sizes of the published model, and the parts to leave out.

    Attributes:
        use_references: False leaves out references, warp and aggregation.
        use_speech: False leaves out A.
        use_warp: False keeps references without equations (3) and (4).
        slot_noise: whether slots start from noise, as published; see `slot_attention`.
        speech_dim: D, features of a step of a speech window.
        code_dim: width of A.
        feature_dim: channels of F_n.
        cnn_width: channels of the convolutions before F_n.
        slots: slots of the aggregation.
        slot_dim: numbers of a slot.
        width: of the radiance MLP.
        depth: layers of the radiance MLP before the density.
        colour_width: of its layers before the colour.
        max_offset: largest warp, pixels of the reference.
        coarse_samples: of the first pass, the background's at `far` included.
        fine_samples: added to them in the second.
    """

    use_references: bool = True
    use_speech: bool = True
    use_warp: bool = True
    slot_noise: bool = True
    speech_dim: int = 29
    code_dim: int = 64
    feature_dim: int = 128
    cnn_width: int = 64
    slots: int = 2
    slot_dim: int = 128
    width: int = 256
    depth: int = 8
    colour_width: int = 128
    max_offset: float = MAX_OFFSET
    coarse_samples: int = 32
    fine_samples: int = 64


@dataclass(frozen=True)
class References:
    """Reference frames and their cameras.

    Attributes:
        images: colours in 0..1.
        c2w: camera to world.
        focal: pixels.
        centre: principal points (column, row); the published model takes the middle of the image.
    """

    images: Float[Tensor, "N H W 3"]
    c2w: Float[Tensor, "N 3 4"]
    focal: float | Float[Tensor, "#N"]
    centre: Float[Tensor, "#N 2"]


@dataclass(frozen=True)
class EncodedReferences:
    """References with their features F_n. They are fixed for a person: compute them once."""

    features: Float[Tensor, "N H W C"]
    views: References


@dataclass(frozen=True)
class FrameConditions:
    """Inputs of the field for a frame, besides points.

    Attributes:
        code: A of the frame; empty without speech.
        references: with their features; None for a field without references.
        warp: False in the coarse stage of training.
        fresh_noise: whether slots start from noise drawn anew, as in training; False takes the
            noise of rendering.
        generator: of fresh noise.
    """

    code: Float[Tensor, " A"]
    references: EncodedReferences | None
    warp: bool = True
    fresh_noise: bool = False
    generator: torch.Generator | None = None


@dataclass(frozen=True)
class Samples:
    """Raw colour and density, and the warp, of points.

    Attributes:
        colour: raw, before the sigmoid.
        density: raw, before `dfrf.published.radiance_field.density`.
        offset: warp (column, row), pixels of the reference; no rows without references.
        feature: aggregated; of width 0 without references.
    """

    colour: Float[Tensor, "R S 3"]
    density: Float[Tensor, "R S"]
    offset: Float[Tensor, "N R S 2"]
    feature: Float[Tensor, "R S F"]


class PaperField(nn.Module):
    """Equations (1) to (7); one encoder, warp and aggregation serve both networks."""

    def __init__(self, config: PaperConfig) -> None:
        super().__init__()
        self.config = config
        point_dim = encoded_size(POINT_OCTAVES)
        input_dim = point_dim
        if config.use_speech:
            input_dim += config.code_dim
        if config.use_references:
            self.encoder = ReferenceCNN(config.cnn_width, config.feature_dim)
            self.aggregation = SlotAttention(
                token_dim=config.feature_dim + TOKEN_EXTRA, dim=config.slot_dim, slots=config.slots
            )
            input_dim += self.aggregation.out_dim
            if config.use_warp:
                code_dim = config.code_dim if config.use_speech else 0
                self.warp = WarpMLP(
                    point_dim, code_dim, config.feature_dim, max_offset=config.max_offset
                )
        sizes = {
            "input_dim": input_dim,
            "width": config.width,
            "depth": config.depth,
            "colour_width": config.colour_width,
        }
        self.coarse = RadianceMLP(**sizes)
        self.fine = RadianceMLP(**sizes)

    def look_up(
        self,
        points: Float[Tensor, "M 3"],
        encoded: Float[Tensor, "M E"],
        code: Float[Tensor, " A"],
        references: EncodedReferences,
        warp: bool = True,
    ) -> tuple[Float[Tensor, "N M T"], Float[Tensor, "N M 2"]]:
        """Equations (1), (3) and (4): features of each point in each reference, and its offset.

        As published, offsets start at the nearest pixel's centre, no gradient flows through the
        warp's inputs, and the pixel that is read (row, column; whole numbers) is appended.
        """
        maps, views = references.features, references.views
        height, width = maps.shape[1:3]
        projected = project(points, views.c2w, views.focal, views.centre)
        pixel = clamp_to_image(projected, height, width).round()
        offset = torch.zeros_like(pixel)
        if warp and self.config.use_warp:
            offset = self.warp(encoded, code.detach(), nearest(maps.detach(), pixel))
        # Equation (4); the paper adds the offset to the projected position, unrounded.
        place = clamp_to_image(pixel + offset, height, width)
        where = place.detach().trunc().flip(-1)
        return torch.cat([bilinear(maps, place), where], -1), offset

    def forward(
        self,
        network: RadianceMLP,
        points: Float[Tensor, "R S 3"],
        directions: Float[Tensor, "R 3"],
        conditions: FrameConditions,
    ) -> Samples:
        """Raw colour and density of points, seen along unit directions.

        Args:
            network: `self.coarse` or `self.fine`.
            points: in the world.
            directions: of the rays, of length 1.
            conditions: of the frame.
        """
        rays, count = points.shape[:2]
        code, references = conditions.code, conditions.references
        flat = points.reshape(-1, 3)
        encoded = frequency_encoding(flat, POINT_OCTAVES)
        parts = [encoded, code.expand(flat.shape[0], -1)]
        offset = points.new_zeros(0, flat.shape[0], 2)
        feature = points.new_zeros(flat.shape[0], 0)
        if references is not None:
            tokens, offset = self.look_up(flat, encoded, code, references, conditions.warp)
            start = None
            if self.config.slot_noise:
                if conditions.fresh_noise:
                    start = self.aggregation.noise(flat.shape[0], conditions.generator)
                else:
                    start = self.aggregation.rendering_noise(count).repeat(rays, 1, 1)
            feature = self.aggregation(tokens, encoded, start)
            parts.insert(0, feature)
        views = frequency_encoding(directions, DIRECTION_OCTAVES).repeat_interleave(count, 0)
        colour, density = network(torch.cat(parts, -1), views)
        return Samples(
            colour=colour.view(rays, count, 3),
            density=density.view(rays, count),
            offset=offset.view(-1, rays, count, 2),
            feature=feature.view(rays, count, -1),
        )
