"""One person's material, ready in memory as uint8, and the rays drawn from it.

T frames with pictures, C frames in a row, B rays, S the crop's side in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.cameras import pixel_rays
from dfrf.config import TrainConfig
from dfrf.field import eyelid_deformation as lids
from dfrf.field.reference_maps import ReferenceViews

# Codes of the region map: where rays are drawn.
OUTSIDE, RIM, HEAD, MOUTH, EYES = 0, 1, 2, 3, 4
HEAD_MATTE = 13  # of 255: what counts as head
ALIKE = 0.25  # of a person's frames, those turned nearest to one of them
# The measures of the upper face of a mirrored person: which measure each one is, and its sign.
# Lids left, right, brows left, right, gaze to the right, gaze downwards.
MIRRORED_UPPER = ((1, 1), (0, 1), (3, 1), (2, 1), (4, -1), (5, 1))


@dataclass(frozen=True)
class Identity:
    """Frames of one person with everything training needs.

    Attributes:
        name: for messages.
        images, backgrounds: (T, S, S, 3) uint8.
        mattes: (T, S, S) uint8, opacity of the head.
        regions: (T, S, S) uint8, codes above.
        c2w: (T, 3, 4) camera to head frame.
        focal: pixels.
        centres: (T, 2) principal points, (column, row).
        upper: (T, U) measures of lids, brows and gaze, 0 at rest; their order is that of
            `MIRRORED_UPPER`.
        number: (T,) which of the C frames each picture is of. Speech needs every frame, also where
            only some are kept as pictures.
        windows: (C, 16, D) speech windows.
        lips: (C, K) lip measures, each of mean 0 and variance 1.
        segment: (C,) which uncut run of the clip a frame belongs to.
        eyes: (2, 7) where the eyes are, see `dfrf.field.eyelid_deformation`.
        surface: (V, 3) rigid points of the mean face, head frame (y up).
    """

    name: str
    images: Tensor
    backgrounds: Tensor
    mattes: Tensor
    regions: Tensor
    c2w: Tensor
    focal: float
    centres: Tensor
    upper: Tensor
    number: Tensor
    windows: Tensor
    lips: Tensor
    segment: Tensor
    eyes: Tensor
    surface: Tensor

    @property
    def frames(self) -> int:
        """T."""
        return self.images.shape[0]

    @property
    def size(self) -> int:
        """S."""
        return self.images.shape[1]


@dataclass(frozen=True)
class RayBatch:
    """Rays of a few frames of one person.

    Attributes:
        origins, directions: (B, 3), directions of unit length.
        frame: (B,) index into `frames`.
        frames: (F,) frame numbers of the identity.
        colour, background: (B, 3) in 0..1.
        matte: (B,) in 0..1.
    """

    origins: Tensor
    directions: Tensor
    frame: Tensor
    frames: Tensor
    colour: Tensor
    background: Tensor
    matte: Tensor

    def to(self, device: torch.device) -> RayBatch:
        """The same rays on a device; `frames` stays where the identity is."""
        moved = {
            f.name: getattr(self, f.name).to(device) for f in fields(self) if f.name != "frames"
        }
        return RayBatch(**moved, frames=self.frames)


def neighbour_windows(windows: Tensor, segment: Tensor, frames: Tensor, count: int = 8) -> Tensor:
    """Windows of the neighbours of frames, (F, count, 16, D), from windows (C, 16, D).

    Neighbours are frames i - count/2 .. i + count/2 - 1; beyond a cut or an end the nearest frame
    of the same uncut run stands in, so nothing reaches across a cut.
    """
    last = windows.shape[0] - 1
    offsets = torch.arange(count, device=frames.device) - count // 2
    index = (frames[:, None] + offsets).clamp(0, last)
    same = segment[index] == segment[frames][:, None]
    # Walk towards the frame itself until the run is the same.
    for _ in range(count // 2):
        step = torch.sign(frames[:, None] - index)
        index = torch.where(same, index, index + step)
        same = segment[index] == segment[frames][:, None]
    return windows[index]


def frames_alike(person: Identity, count: int, generator: torch.Generator) -> Tensor:
    """Any frame of a person, and others among the `ALIKE` that show the head most nearly as it."""
    seen_from = F.normalize(person.c2w[:, :, 3], dim=-1)
    one = torch.randint(person.frames, (1,), generator=generator)
    apart = (seen_from - seen_from[one]).norm(dim=-1)
    alike = apart.argsort()[: max(count, round(ALIKE * person.frames))]
    others = torch.randint(len(alike), (count - 1,), generator=generator)
    return torch.cat([one, alike[others]])


def draw_rays(
    person: Identity, frames: Tensor, config: TrainConfig, generator: torch.Generator
) -> RayBatch:
    """Rays of frames (F,) by importance: mouth, eyes, rim, the rest of the head, outside."""
    per_frame = config.rays // len(frames)
    beside = config.rim_share + config.outside_share
    shares = (
        (MOUTH, config.mouth_share),
        (EYES, config.eyes_share),
        (RIM, config.rim_share),
        (HEAD, 1 - config.mouth_share - config.eyes_share - beside),
        (OUTSIDE, config.outside_share),
    )
    pixels, owner = [], []
    for i, t in enumerate(frames.tolist()):
        # numpy finds the pixels of a region five times as fast as torch does.
        region = person.regions[t].view(-1).numpy()
        drawn = []
        for code, share in shares:
            if not share:
                continue
            where = np.flatnonzero(region == code)
            if where.size:
                pick = torch.randint(where.size, (round(per_frame * share),), generator=generator)
                drawn.append(torch.from_numpy(where[pick.numpy()]))
        if not drawn:
            continue
        chosen = torch.cat(drawn)
        pixels.append(chosen)
        owner.append(torch.full_like(chosen, i))
    if not pixels:
        raise ValueError(f"{person.name}: the drawn frames show no head")
    pixel, frame = torch.cat(pixels), torch.cat(owner)
    rows, columns = pixel // person.size, pixel % person.size
    number = frames[frame]
    origins, directions = pixel_rays(
        person.c2w[number],
        person.focal,
        person.centres[number],
        torch.stack([columns, rows], -1).float(),
    )
    directions = F.normalize(directions, dim=-1)

    def at(images: Tensor) -> Tensor:
        return images[number, rows, columns].float() / 255

    return RayBatch(
        origins=origins,
        directions=directions,
        frame=frame,
        frames=frames,
        colour=at(person.images),
        background=at(person.backgrounds),
        matte=at(person.mattes),
    )


def surface_rays(
    person: Identity, frames: Tensor, per_frame: int, generator: torch.Generator
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Rays through points of the mean face, for frames (F,) of a person.

    Returns:
        origins (B, 3), unit directions (B, 3), frame (B,) index into frames, and the distance (B,)
        of the point along its ray.
    """
    pick = torch.randint(person.surface.shape[0], (frames.numel(), per_frame), generator=generator)
    points = person.surface[pick].view(-1, 3)
    frame = torch.arange(frames.numel()).repeat_interleave(per_frame)
    origins = person.c2w[frames][frame][:, :, 3]
    gap = points - origins
    distance = gap.norm(dim=-1)
    return origins, gap / distance[:, None], frame, distance


def cut_references(person: Identity, frames: Tensor, asked: Tensor | None = None) -> ReferenceViews:
    """Reference views of frames (N,), cut to the box that holds their heads.

    Where the person blinks, a frame with shut eyes is added for the lids, none of those `asked`.
    """
    among = torch.arange(person.frames)
    if asked is not None:
        among = among[~torch.isin(among, asked)]
    measures, forward = person.upper[among][:, lids.MEASURES], person.c2w[among][:, :, 2]
    blink = lids.shut_frame(person.eyes, measures, forward)
    if blink is not None:
        frames = torch.cat([frames, among[blink : blink + 1]])
    margin = round(0.03 * person.size)
    heads = person.mattes[frames] > HEAD_MATTE
    rows, columns = heads.any(2), heads.any(1)
    corners, sides = [], []
    for n in range(frames.numel()):
        r, c = rows[n].nonzero(), columns[n].nonzero()
        if not r.numel():
            r = c = torch.tensor([0, person.size - 1])
        top, left = max(int(r.min()) - margin, 0), max(int(c.min()) - margin, 0)
        bottom = min(int(r.max()) + margin + 1, person.size)
        right = min(int(c.max()) + margin + 1, person.size)
        corners.append((top, left))
        sides.append((bottom - top, right - left))
    height, width = max(s[0] for s in sides), max(s[1] for s in sides)
    images, mattes, centres = [], [], []
    for n, t in enumerate(frames.tolist()):
        top = min(corners[n][0], person.size - height)
        left = min(corners[n][1], person.size - width)
        images.append(person.images[t, top : top + height, left : left + width])
        mattes.append(person.mattes[t, top : top + height, left : left + width])
        centres.append(person.centres[t] - person.centres.new_tensor([left, top]))
    return ReferenceViews(
        images=torch.stack(images),
        mattes=torch.stack(mattes),
        c2w=person.c2w[frames],
        focal=person.focal,
        centres=torch.stack(centres),
        upper=person.upper[frames],
        eyes=person.eyes,
        scale=person.size / 512,
        blinks=int(blink is not None),
    )
