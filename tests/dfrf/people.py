"""A tiny person made of formulas: an ellipsoid with a painted face, seen from a few poses."""

from __future__ import annotations

import torch

from dfrf import presets
from dfrf.config import FieldConfig, MarchConfig, ModelConfig
from dfrf.data.dataset import EYES, HEAD, MOUTH, RIM, HeadDataset
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_model import FastModel
from dfrf.field.field import PRIOR_CENTRE, PRIOR_RADII
from dfrf.field.mouth_pixels import LIP_POINTS
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.field.speaker_adaptation import HEARD

SIZE = 48
FOCAL = 110.0


def small_config(**changes: object) -> ModelConfig:
    """The `fast` configuration made tiny."""
    field = FieldConfig(
        speech_dim=8, references=2, feature_dim=12, cnn_width=8, token_dim=8, width=16, depth=2
    )
    field = FieldConfig(**{**field.__dict__, **changes})
    return ModelConfig(preset="fast", march=MarchConfig(resolution=24, step=0.1), field=field)


def person(frames: int = 6, seed: int = 0) -> HeadDataset:
    """Frames of an ellipsoid head that turns, lit by its own position, before grey."""
    generator = torch.Generator().manual_seed(seed)
    c2w = torch.eye(3, 4).repeat(frames, 1, 1)
    c2w[:, 2, 3] = 7.0
    c2w[:, 0, 3] = torch.linspace(-0.4, 0.4, frames)
    rows, columns = torch.meshgrid(torch.arange(SIZE), torch.arange(SIZE), indexing="ij")
    centre = (SIZE - 1) / 2
    directions = torch.stack(
        [(columns - centre) / FOCAL, -(rows - centre) / FOCAL, -torch.ones(SIZE, SIZE)], -1
    )
    images = torch.full((frames, SIZE, SIZE, 3), 90, dtype=torch.uint8)
    mattes = torch.zeros(frames, SIZE, SIZE, dtype=torch.uint8)
    for t in range(frames):
        # |o + s d| in the ellipsoid's own measure is a quadratic in s: its first root is the skin.
        radii, middle = torch.tensor(PRIOR_RADII), torch.tensor(PRIOR_CENTRE)
        o, d = (c2w[t, :, 3] - middle) / radii, directions / radii
        a, b, c = (d * d).sum(-1), 2 * (o * d).sum(-1), (o * o).sum(-1) - 0.9**2
        root = b * b - 4 * a * c
        hit = root > 0
        s = (-b - root.clamp_min(0).sqrt()) / (2 * a)
        points = c2w[t, :, 3] + s[..., None] * directions
        colour = (0.5 + 0.3 * torch.sin(3 * points)).clamp(0, 1) * 255
        images[t][hit] = colour[hit].to(torch.uint8)
        mattes[t][hit] = 255
    regions = torch.where(mattes > 0, HEAD, RIM).to(torch.uint8)
    regions[:, 26:32, 20:28] = MOUTH
    regions[:, 18:21, 18:30] = EYES
    windows = torch.randn(frames, 16, 8, generator=generator)
    lips = torch.randn(frames, 7, generator=generator)
    expression = torch.randn(frames, 6, generator=generator)
    heard = torch.randn(frames, HEARD, generator=generator)
    return HeadDataset(
        name="ellipsoid",
        images=images,
        backgrounds=torch.full_like(images, 90),
        mattes=mattes,
        regions=regions,
        c2w=c2w,
        focal=FOCAL,
        centres=torch.full((frames, 2), centre),
        number=torch.arange(frames),
        windows=windows,
        predicted_lips=torch.cat([lips, -lips[:, :1], heard], 1),
        lips=lips,
        touching=(lips[:, 0] < -1).float(),
        expression=expression,
        segment=torch.zeros(frames, dtype=torch.long),
        surface=torch.tensor([[0.0, 0.1, 0.89], [0.2, 0.2, 0.84]]),
        lip_shape=lip_shape(),
        lip_points=0.02 * torch.randn(frames, LIP_POINTS, 2, generator=generator),
    )


def lip_shape() -> torch.Tensor:
    """Points of lips, two ellipses, on the skin."""
    angle = torch.linspace(0, 2 * torch.pi, LIP_POINTS // 2 + 1)[:-1]
    ring = torch.stack([angle.cos(), 0.4 * angle.sin(), torch.zeros_like(angle)], 1)
    return torch.cat([0.25 * ring, 0.18 * ring]) + torch.tensor([0.0, -0.4, 0.8])


def random_model() -> tuple[FastModel, ReferenceMaps]:
    """A tiny model, not learned, and its maps of two frames of a person."""
    someone = person()
    model = presets.build(small_config())
    with torch.no_grad():
        maps = model.field.encoder(cut_references(someone, torch.tensor([0, 5])))
    return model.eval(), maps
