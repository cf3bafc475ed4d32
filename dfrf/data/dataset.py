"""Training data of one person: frames with everything training needs, images as uint8.

T frames with images, C frames in a row, S the crop's side in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int, Num, UInt8
from torch import Tensor

from dfrf.field.audio import NEIGHBOURS

# Codes of the region map: where rays are drawn.
OUTSIDE, RIM, HEAD, MOUTH, EYES = 0, 1, 2, 3, 4
HEAD_MATTE = 13  # of 255; larger values count as head
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
        number: frame number, among the C, of each image. Speech needs every frame, even where
            only some have images.
        windows: speech windows.
        predicted_lips: lips predicted from the sound without knowing the speaker, and features of
            the sound, see `dfrf.field.speaker_adaptation`.
        lips: L lip measures, each of mean 0 and variance 1.
        touching: 1 where the inner lips touch.
        segment: which uncut run of the clip a frame belongs to.
        surface: rigid points of the mean face, head frame (y up).
        lip_shape: points of the lips of the mean face, head frame.
        lip_points: positions of the lips in each image relative to these, see `mouth_pixels`.
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
        """T, number of images."""
        return self.images.shape[0]

    @property
    def size(self) -> int:
        """S, side of the crop in pixels."""
        return self.images.shape[1]


def neighbour_windows(
    windows: Float[Tensor, "C W D"], segment: Num[Tensor, " C"], frames: Int[Tensor, " F"]
) -> Float[Tensor, "F 8 W D"]:
    """Windows of the neighbours of frames: i - 4 .. i + 3.

    Beyond a cut or an end the nearest frame of the same uncut run stands in, so nothing reaches
    across a cut.
    """
    last = windows.shape[0] - 1
    offsets = torch.arange(NEIGHBOURS, device=frames.device) - NEIGHBOURS // 2
    index = (frames[:, None] + offsets).clamp(0, last)
    same = segment[index] == segment[frames][:, None]
    # Walk towards the frame itself until the run is the same.
    for _ in range(NEIGHBOURS // 2):
        step = torch.sign(frames[:, None] - index)
        index = torch.where(same, index, index + step)
        same = segment[index] == segment[frames][:, None]
    return windows[index]
