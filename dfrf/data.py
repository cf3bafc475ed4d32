"""What of one person is learned from, pictures as uint8, and the rays drawn from it.

T frames with pictures, C frames in a row, B rays, S the crop's side in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float, Int, Num, UInt8
from torch import Tensor

from dfrf.cameras import Rays, pixel_rays, project
from dfrf.config import TrainConfig
from dfrf.field.mouth_views import fit_reading, region
from dfrf.field.reference_views import MouthViews, ReferenceViews

# Codes of the region map: where rays are drawn.
OUTSIDE, RIM, HEAD, MOUTH, EYES = 0, 1, 2, 3, 4
HEAD_MATTE = 13  # of 255: what counts as head
MARGIN = 0.03  # of the crop's side, round the heads of reference views
ALIKE = 0.25  # of a person's frames, those turned nearest to one of them
# The measures of the upper face of a mirrored person: which measure each one is, and its sign.
# Lids left, right, brows left, right, gaze to the right, gaze downwards.
MIRRORED_EXPRESSION = ((1, 1), (0, 1), (3, 1), (2, 1), (4, -1), (5, 1))


@dataclass(frozen=True)
class HeadDataset:
    """Frames of one person with everything training needs.

    Attributes:
        name: for messages.
        images, backgrounds: colours.
        mattes: opacity of the head.
        regions: codes above.
        c2w: camera to head frame.
        focal: pixels.
        centres: principal points, (column, row).
        expression: measures of lids, brows and gaze, 0 at rest; their order is that of
            `MIRRORED_EXPRESSION`.
        number: which of the C frames each picture is of. Speech needs every frame, also where
            only some are kept as pictures.
        windows: speech windows.
        predicted_lips: what the sound says of the lips of people in general, see
            `dfrf.field.speaker_adaptation`.
        lips: L lip measures, each of mean 0 and variance 1.
        touching: 1 where the inner lips touch.
        segment: which uncut run of the clip a frame belongs to.
        surface: rigid points of the mean face, head frame (y up).
        lip_shape: points of the lips of the mean face, head frame.
        lip_points: how far the lips of each picture lie beside these, see `mouth_views`.
    """

    name: str
    images: UInt8[Tensor, "T S S 3"]
    backgrounds: UInt8[Tensor, "T S S 3"]
    mattes: UInt8[Tensor, "T S S"]
    regions: UInt8[Tensor, "T S S"]
    c2w: Float[Tensor, "T 3 4"]
    focal: float
    centres: Float[Tensor, "T 2"]
    expression: Float[Tensor, "T U"]
    number: Int[Tensor, " T"]
    windows: Float[Tensor, "C W D"]
    predicted_lips: Float[Tensor, "C P"]
    lips: Float[Tensor, "C L"]
    touching: Float[Tensor, " C"]
    segment: Int[Tensor, " C"]
    surface: Float[Tensor, "V 3"]
    lip_shape: Float[Tensor, "Q 3"]
    lip_points: Float[Tensor, "T Q 2"]

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
        origins, directions: head frame, directions of unit length.
        frame: index into `frames`.
        frames: frame numbers of the dataset.
        colour, background, matte: in 0..1.
    """

    origins: Float[Tensor, "B 3"]
    directions: Float[Tensor, "B 3"]
    frame: Int[Tensor, " B"]
    frames: Int[Tensor, " F"]
    colour: Float[Tensor, "B 3"]
    background: Float[Tensor, "B 3"]
    matte: Float[Tensor, " B"]

    @property
    def rays(self) -> Rays:
        """The rays alone."""
        return Rays(self.origins, self.directions, self.frame)

    def to(self, device: torch.device) -> RayBatch:
        """The same rays on a device; `frames` stays where the dataset is."""
        moved = {
            f.name: getattr(self, f.name).to(device) for f in fields(self) if f.name != "frames"
        }
        return RayBatch(**moved, frames=self.frames)


def neighbour_windows(
    windows: Float[Tensor, "C W D"],
    segment: Num[Tensor, " C"],
    frames: Int[Tensor, " F"],
    count: int = 8,
) -> Float[Tensor, "F K W D"]:
    """Windows of the neighbours of frames, K = count of each.

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


def frames_alike(dataset: HeadDataset, count: int, generator: torch.Generator) -> Int[Tensor, " F"]:
    """Any frame of a person, and others among the `ALIKE` that show the head most nearly as it."""
    viewpoint = F.normalize(dataset.c2w[:, :, 3], dim=-1)
    one = torch.randint(dataset.frames, (1,), generator=generator)
    apart = (viewpoint - viewpoint[one]).norm(dim=-1)
    alike = apart.argsort()[: max(count, round(ALIKE * dataset.frames))]
    others = torch.randint(len(alike), (count - 1,), generator=generator)
    return torch.cat([one, alike[others]])


def draw_rays(
    dataset: HeadDataset,
    frames: Int[Tensor, " F"],
    config: TrainConfig,
    generator: torch.Generator,
) -> RayBatch:
    """Rays of frames by importance: mouth, eyes, rim, the rest of the head, outside."""
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
        region = dataset.regions[t].view(-1).numpy()
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
        raise ValueError(f"{dataset.name}: the drawn frames show no head")
    pixel, frame = torch.cat(pixels), torch.cat(owner)
    rows, columns = pixel // dataset.size, pixel % dataset.size
    number = frames[frame]
    origins, directions = pixel_rays(
        dataset.c2w[number],
        dataset.focal,
        dataset.centres[number],
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
        colour=at(dataset.images),
        background=at(dataset.backgrounds),
        matte=at(dataset.mattes),
    )


@dataclass(frozen=True)
class SurfaceRays:
    """Rays through points of the mean face.

    Attributes:
        rays: their frame is an index into the frames that were asked for.
        distance: of the point along its ray, head units.
    """

    rays: Rays
    distance: Float[Tensor, " B"]

    def to(self, device: torch.device) -> SurfaceRays:
        """The same on a device."""
        rays = (self.rays.origins, self.rays.directions, self.rays.frame)
        return SurfaceRays(Rays(*(r.to(device) for r in rays)), self.distance.to(device))


def surface_rays(
    dataset: HeadDataset,
    frames: Int[Tensor, " F"],
    per_frame: int,
    generator: torch.Generator,
) -> SurfaceRays:
    """Rays through random points of the mean face, `per_frame` for each frame of a dataset."""
    count = (frames.numel(), per_frame)
    pick = torch.randint(dataset.surface.shape[0], count, generator=generator)
    points = dataset.surface[pick].view(-1, 3)
    frame = torch.arange(frames.numel()).repeat_interleave(per_frame)
    origins = dataset.c2w[frames][frame][:, :, 3]
    gap = points - origins
    distance = gap.norm(dim=-1)
    return SurfaceRays(Rays(origins, gap / distance[:, None], frame), distance)


def head_boxes(
    mattes: UInt8[Tensor, "N S S"], margin: int
) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Corner (top, left) of a box round the head in each matte, and the size that holds each."""
    size = mattes.shape[1]
    heads = mattes > HEAD_MATTE
    rows, columns = heads.any(2), heads.any(1)
    corners, sides = [], []
    for n in range(len(mattes)):
        r, c = rows[n].nonzero(), columns[n].nonzero()
        if not r.numel():
            r = c = torch.tensor([0, size - 1])
        top, left = max(int(r.min()) - margin, 0), max(int(c.min()) - margin, 0)
        bottom = min(int(r.max()) + margin + 1, size)
        right = min(int(c.max()) + margin + 1, size)
        corners.append((top, left))
        sides.append((bottom - top, right - left))
    height, width = max(s[0] for s in sides), max(s[1] for s in sides)
    corners = [(min(top, size - height), min(left, size - width)) for top, left in corners]
    return corners, (height, width)


def cut_references(dataset: HeadDataset, frames: Int[Tensor, " N"]) -> ReferenceViews:
    """Reference views of frames, cut to the box that holds their heads."""
    corners, (height, width) = head_boxes(dataset.mattes[frames], round(MARGIN * dataset.size))
    images, mattes, centres = [], [], []
    for t, (top, left) in zip(frames.tolist(), corners, strict=True):
        images.append(dataset.images[t, top : top + height, left : left + width])
        mattes.append(dataset.mattes[t, top : top + height, left : left + width])
        centres.append(dataset.centres[t] - dataset.centres.new_tensor([left, top]))
    return ReferenceViews(
        images=torch.stack(images),
        mattes=torch.stack(mattes),
        c2w=dataset.c2w[frames],
        focal=dataset.focal,
        centres=torch.stack(centres),
        scale=dataset.size / 512,
    )


def cut_mouths(
    dataset: HeadDataset, frames: Int[Tensor, " P"], measures: Float[Tensor, "T L"]
) -> MouthViews:
    """Crops round the mouths of frames, as large as the mouth region needs in any of them.

    Args:
        dataset: of the person.
        frames: which to take.
        measures: of the lips of all pictures, as they are read off codes.
    """
    middle, reach = region(dataset.lip_shape)
    corners = torch.cartesian_prod(*[torch.tensor([-1.0, 1.0])] * 3)
    seen = project(
        middle + reach * corners, dataset.c2w[frames], dataset.focal, dataset.centres[frames]
    )
    margin = MARGIN / 2 * dataset.size
    low, high = (seen.amin(1) - margin).floor().long(), (seen.amax(1) + margin).ceil().long()
    width, height = (high - low).amax(0).clamp(max=dataset.size).tolist()
    most = torch.tensor([dataset.size - width, dataset.size - height])
    left_top = torch.minimum(low.clamp_min(0), most)
    boxes = [(slice(y, y + height), slice(x, x + width)) for x, y in left_top.tolist()]
    cut = list(zip(frames.tolist(), boxes, strict=True))
    views = ReferenceViews(
        images=torch.stack([dataset.images[t][box] for t, box in cut]),
        mattes=torch.stack([dataset.mattes[t][box] for t, box in cut]),
        c2w=dataset.c2w[frames],
        focal=dataset.focal,
        centres=dataset.centres[frames] - left_top,
        scale=dataset.size / 512,
    )
    return MouthViews(
        views,
        dataset.lip_points[frames],
        dataset.lip_shape,
        fit_reading(measures, dataset.c2w, dataset.lip_points),
        frames,
        dataset.lip_points,
    )
