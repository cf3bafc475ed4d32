"""The `fast` field: equations (1) to (7) with one deterministic attention over the references.

How references are encoded, warped and weighed is in `fast_references`. M points, N references, F
frames in a batch, C feature channels, D speech features.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from dfrf import device as devices
from dfrf.config import FieldConfig, ModelConfig
from dfrf.encodings import frequency_encoding
from dfrf.field import brow_deformation as brows
from dfrf.field import eyelid_deformation as lids
from dfrf.field.audio import LEAK, AudioAttNet, AudioNet
from dfrf.field.reference_fusion import COLOUR, Aggregation, ReferenceEncoder, Warp, of_points
from dfrf.field.reference_maps import ReferenceMaps, ReferenceViews
from dfrf.head_model import HeadModel
from dfrf.rendering.occupancy import OccupancyGrid

LIP_MEASURES = 7
REACH = 3  # frames to each side whose lips have a say in a frame's, see `manner`
OWN = slice(REACH * LIP_MEASURES, (REACH + 1) * LIP_MEASURES)  # the frame's own in such a row
PRIOR_CENTRE = (0.0, 0.1, -0.05)
PRIOR_RADII = (0.85, 1.25, 1.05)
PRIOR_SLOPE = 20.0
DENSITY_SCALE = 25.0
# How far from the usual a code goes where no lips are read off it. Fifteen seconds show few codes:
# one unlike all of them drew specks beside the lips, which said nothing unusual.
BESIDE_LIPS = 0.5


@dataclass(frozen=True)
class FieldOutput:
    """What the field says of M points.

    Attributes:
        density: (M,) per head unit.
        colour: (M, 3) in 0..1.
        offset: (N, M, 2) warp, pixels at 512 (column, row); zeros without warp.
    """

    density: Tensor
    colour: Tensor
    offset: Tensor


@dataclass(frozen=True)
class Asked:
    """M points that the field is asked of.

    Attributes:
        points, directions: (M, 3), the latter of unit length.
        encoded: (M, P) the points where they are at rest.
        belongs: (M, F) 1 where a point belongs to a frame.
        raised, opened: (M or 1, 2) measures of the brows and of the lids in its frame.
        shares: (M, 2) how much brows move it.
        at_eyes: (K,) the points that lids may move.
    """

    points: Tensor
    directions: Tensor
    encoded: Tensor
    belongs: Tensor
    raised: Tensor
    opened: Tensor
    shares: Tensor
    at_eyes: Tensor

    def only(self, at: Tensor) -> Asked:
        """The points `at` (K,), all of which lids may move."""

        def rows(values: Tensor) -> Tensor:
            return values if len(values) == 1 else values.index_select(0, at)

        return Asked(
            self.points[at],
            self.directions[at],
            self.encoded[at],
            self.belongs[at],
            rows(self.raised),
            rows(self.opened),
            self.shares[at],
            torch.arange(len(at), device=at.device),
        )

    def lifts(self, views: ReferenceViews, which: slice) -> Tensor:
        """How much higher than in n of the views the points are, (n, M) head units."""
        upper = views.upper[which]
        lift = brows.lifts(self.shares, self.raised - upper[:, None, brows.MEASURES])
        theirs = upper[:, lids.MEASURES]
        lids.add_lifts(lift, self.points, self.at_eyes, views.eyes, self.opened, theirs)
        return lift


def rows_of_neighbours(said: Tensor) -> Tensor:
    """Measures (C + 2R, K) of frames in a row: each frame's with those of R = REACH to each side.

    Returns:
        (C, (2R + 1) K), the earliest first.
    """
    return said.unfold(0, 2 * REACH + 1, 1).mT.flatten(1)


class Field(nn.Module):
    """F_theta of equation (7), with everything that feeds it."""

    shut: Tensor
    usual: Tensor
    brow_range: Tensor

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        self.config = config
        # Least and most that each brow is up in a picture, (2, 2).
        self.register_buffer("brow_range", torch.tensor([[-torch.inf] * 2, [torch.inf] * 2]))
        point_dim = 3 + 6 * config.point_octaves
        direction_dim = 3 + 6 * config.direction_octaves
        width = config.width
        if config.use_speech:
            self.audio = AudioNet(config.speech_dim, config.code_dim)
            self.attention = AudioAttNet()
            # Reads lip measures off the code; pictures do not use it.
            self.lips = nn.Linear(config.code_dim, LIP_MEASURES)
            # What it reads where the person's mouth is shut.
            self.register_buffer("shut", torch.zeros(LIP_MEASURES))
            # The mean code of the frames the person was learned from.
            self.register_buffer("usual", torch.zeros(config.code_dim))
            # What the lips do where a frame and its neighbours say so much: at first, just that.
            self.manner = nn.Linear((2 * REACH + 1) * LIP_MEASURES, LIP_MEASURES)
            nn.init.zeros_(self.manner.bias)
            nn.init.zeros_(self.manner.weight)
            nn.init.eye_(self.manner.weight[:, OWN])
            for layer in self.audio.modules():
                if isinstance(layer, nn.Conv1d | nn.Linear) and layer.bias is not None:
                    # The default start gives the same code for every sound.
                    nn.init.kaiming_normal_(layer.weight, a=LEAK)
                    nn.init.zeros_(layer.bias)
        aggregated = 0
        if config.references:
            self.encoder = ReferenceEncoder(config)
            self.aggregation = Aggregation(config, point_dim)
            aggregated = self.aggregation.out_dim
            if config.use_warp:
                self.warp = Warp(config, point_dim)
        self.input = nn.Linear(point_dim + aggregated, width)
        self.speech = nn.Linear(config.told_dim, width, bias=False)
        self.hidden = nn.ModuleList(nn.Linear(width, width) for _ in range(config.depth - 1))
        self.density = nn.Linear(width, 1)
        self.view = nn.Linear(width + direction_dim, 64)
        self.colour = nn.Linear(64, 4)
        nn.init.zeros_(self.density.bias)

    def speech_codes(self, windows: Tensor) -> Tensor:
        """A of each frame, (F, code_dim), from the windows of its neighbours (F, 8, 16, D)."""
        if not self.config.use_speech:
            return windows.new_zeros(windows.shape[0], self.config.code_dim)
        frames, near = windows.shape[:2]
        # Features are 0 in silence and about 1 in speech: centred, a network learns from both.
        codes = self.audio(windows.flatten(0, 1) * 2 - 1).view(frames, near, -1)
        return self.attention(codes)

    def saying(self, codes: Tensor, lips: Tensor) -> Tensor:
        """Codes (F, A) moved by the shortest way to where the lip measures (F, K) are read off."""
        return codes + (lips - self.lips(codes)) @ torch.linalg.pinv(self.lips.weight).T

    def told(self, windows: Tensor, upper: Tensor) -> Tensor:
        """What the field is told of frames in a row, (F, told_dim), when they speak.

        Where nothing is heard, features are 0 and the mouth is shut.

        Args:
            windows: (F + 2 REACH, 8, 16, D) of these frames and of those beside them.
            upper: (F, U) measures of the upper face.
        """
        codes = self.speech_codes(windows)
        count = upper.shape[0]
        if self.config.use_speech:
            said = self.manner(rows_of_neighbours(self.lips(codes)))
            nearer = self.usual + BESIDE_LIPS * (codes[REACH : REACH + count] - self.usual)
            codes = self.saying(nearer, said)
            windows = windows[REACH : REACH + count]
            own = windows[:, windows.shape[1] // 2]
            quarter = own.shape[1] // 4
            silent = (own[:, quarter:-quarter] == 0).all(-1).to(codes.dtype).mean(1, keepdim=True)
            codes = codes + silent * (self.saying(codes, self.shut) - codes)
        upper = upper.clone()
        upper[:, brows.MEASURES] = upper[:, brows.MEASURES].clamp(*self.brow_range)
        return torch.cat([codes[:count], upper], -1)

    def looked_up(
        self, asked: Asked, maps: ReferenceMaps, which: slice, codes: Tensor, warp: bool
    ) -> tuple[Tensor, Tensor, Tensor]:
        """What n views show of M points: F~ (M, out_dim), colour (M, 3), offset (n, M, 2)."""
        views = maps.views
        projected = views.project(asked.points, which, asked.lifts(views, which))
        offset = torch.zeros_like(projected)
        if warp and self.config.use_warp:
            at = maps.nearest(projected, which)
            offset = self.warp(asked.encoded, codes, asked.belongs, at)
        feature = maps.read(projected + offset * views.scale, which)
        towards = views.differences(asked.points, asked.directions, which).to(feature.dtype)
        fused, weight = self.aggregation(
            feature, towards, maps.say[which], asked.encoded, codes, asked.belongs
        )
        return fused, (weight[..., None] * feature[..., COLOUR].float()).sum(0), offset

    def seen(
        self, asked: Asked, maps: ReferenceMaps, codes: Tensor, warp: bool
    ) -> tuple[Tensor, Tensor, Tensor]:
        """What the references show of M points, as `looked_up`: of lids that shut, a blink."""
        views = maps.views
        fused, colour, offset = self.looked_up(asked, maps, views.faces, codes, warp)
        if not views.blinks:
            return fused, colour, offset
        share = lids.shut_shares(asked.points, asked.at_eyes, views.eyes, asked.opened)
        some = share.nonzero().squeeze(1)
        if len(some):
            at, share = asked.at_eyes[some], share[some, None]
            fill = devices.fill(len(at))
            at = torch.cat([at, at[:1].expand(fill)])
            share = F.pad(share, (0, 0, 0, fill))
            blink, shown, _ = self.looked_up(asked.only(at), maps, views.shut, codes, False)
            fused = fused.index_add(0, at, (share * (blink - fused[at])).to(fused.dtype))
            colour = colour.index_add(0, at, share * (shown - colour[at]))
        return fused, colour, offset

    def forward(
        self,
        points: Tensor,
        directions: Tensor,
        frame: Tensor,
        codes: Tensor,
        maps: ReferenceMaps | None,
        warp: bool = True,
    ) -> FieldOutput:
        """Density and colour of points (M, 3) seen along unit directions (M, 3).

        Args:
            frame: (M,) index of the frame of each point into codes (F, told_dim).
            maps: references; None for a field without them.
            warp: False in the coarse stage.
        """
        config = self.config
        # Rounded once, not at every layer that reads them.
        kind = devices.matrix_type(points.device)
        belongs = F.one_hot(frame, codes.shape[0]).to(codes.dtype)
        shares = brows.shares(points)
        upper = of_points(codes[:, config.code_dim :], belongs)
        raised, opened = upper[:, brows.MEASURES], upper[:, lids.MEASURES]
        lift = brows.lifts(shares, raised)
        if maps is not None:
            eyes, codes = maps.views.eyes, lids.untold(codes, config.code_dim)
            at_eyes = lids.near(points, eyes)
            lids.add_lifts(lift[None], points, at_eyes, eyes, opened, opened.new_zeros(1, 2))
        rest = brows.lowered(points, lift)
        encoded = frequency_encoding(rest, config.point_octaves).to(kind)
        parts = [encoded]
        offset = points.new_zeros(0, points.shape[0], 2)
        if maps is not None:
            asked = Asked(points, directions, encoded, belongs, raised, opened, shares, at_eyes)
            fused, blended, offset = self.seen(asked, maps, codes, warp)
            parts.append(fused.to(kind))
        told = of_points(self.speech(codes), belongs)
        h = F.relu(self.input(torch.cat(parts, -1)).add_(told), inplace=True)
        for layer in self.hidden:
            h = F.relu(layer(h), inplace=True)
        centre, radii = points.new_tensor(PRIOR_CENTRE), points.new_tensor(PRIOR_RADII)
        prior = PRIOR_SLOPE * (0.9 - ((rest - centre) / radii).norm(dim=-1))
        density = DENSITY_SCALE * F.softplus(4 * self.density(h).squeeze(-1).float() + prior)
        towards = frequency_encoding(directions, config.direction_octaves).to(kind)
        raw = self.colour(F.relu(self.view(torch.cat([h, towards], -1)), inplace=True)).float()
        own = raw[..., :3].sigmoid()
        if maps is None:
            return FieldOutput(density, own, offset)
        gate = (raw[..., 3:] + 2).sigmoid()
        return FieldOutput(density, gate * blended + (1 - gate) * own, offset)


class Model(HeadModel):
    """A field and the grid that says where it is."""

    FAMILY: ClassVar[str] = "fast"
    config: ModelConfig

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.field = Field(config.field)
        self.grid = OccupancyGrid(config.march.resolution)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        return cls(ModelConfig.from_dict(values))

    def rounded(self) -> Self:
        """A copy to render with: weights of the field as `device.arithmetic` takes them anyway.

        Otherwise every chunk of points would have them rounded anew.
        """
        copied = copy.deepcopy(self)
        copied.field.to(devices.table_type(self.device))
        return copied
