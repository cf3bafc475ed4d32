"""Reference views cut out of a person's frames: whole heads, and crops round mouths."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from dfrf.cameras import project
from dfrf.data.dataset import HEAD_MATTE, HeadDataset
from dfrf.field.mouth_pixels import fit_reading, region
from dfrf.field.reference_views import MouthViews, ReferenceViews

MARGIN = 0.03  # of the crop's side, round the heads of reference views


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
        measures: lip measures of all images, on the scale of those decoded from speech codes.
    """
    middle, reach = region(dataset.lip_shape)
    corners = torch.cartesian_prod(*[torch.tensor([-1.0, 1.0])] * 3)
    projected = project(
        middle + reach * corners, dataset.c2w[frames], dataset.focal, dataset.centres[frames]
    )
    margin = MARGIN / 2 * dataset.size
    low = (projected.amin(1) - margin).floor().long()
    high = (projected.amax(1) + margin).ceil().long()
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
