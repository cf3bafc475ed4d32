"""Buffer of a frame that is rendered coarse to fine: rendered pixels, and those between them.

h x w pixels of a window into the frame, whose first row and column are multiples of the largest
stride; P of them; K anchors (`surface_details`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

OPAQUE = 0.98
# Largest differences between neighbours on one smooth surface: in depth, head units, and in the
# field's residual to the colour of the references.
STEP, ROUGH = 0.2, 0.01
OPACITY, DEPTH, RESIDUAL, ANCHORS = 0, 1, slice(2, 5), slice(5, None)  # of `surface`

Pixels = tuple[Int[Tensor, " P"], Int[Tensor, " P"]]  # rows, columns of the window
# Premultiplied colour in 0..1, and opacity.
HeadImage = tuple[Float[Tensor, "S S 3"], Float[Tensor, "S S"]]


@dataclass(frozen=True)
class Surroundings:
    """Values for P pixels from their neighbours.

    Attributes:
        surface: as `FrameBuffer.surface`, the mean of the nearest neighbours.
        near, far: interval of distances in which they see anything; near > far where none does.
        smooth: whether they all see one smooth and opaque surface.
    """

    surface: Float[Tensor, "P A"]
    near: Float[Tensor, " P"]
    far: Float[Tensor, " P"]
    smooth: Bool[Tensor, " P"]


@dataclass(frozen=True)
class FrameBuffer:
    """A window of a frame.

    Attributes:
        row, column: where the window begins in the frame.
        colour: premultiplied.
        near, far: distances of the first and the last sample of each ray that is not negligible.
        surface: A = 5 + K numbers that change slowly over a surface: opacity, depth, the field's
            residual to the colour of the references (3), and the anchors of the visible point.
    """

    row: int
    column: int
    colour: Float[Tensor, "h w 3"]
    near: Float[Tensor, "h w"]
    far: Float[Tensor, "h w"]
    surface: Float[Tensor, "h w A"]

    @classmethod
    def of_blocks(cls, blocks: Bool[Tensor, "b b"], side: int, anchors: int) -> Self:
        """A blank window that holds blocks of side x side pixels, and a margin of one block."""
        rows, columns = (blocks.any(axis).nonzero()[:, 0] for axis in (1, 0))
        shape = tuple(int(side * (i[-1] - i[0] + 2)) for i in (rows, columns))
        unseen = torch.full(shape, torch.inf, device=blocks.device)
        return cls(
            side * int(rows[0]),
            side * int(columns[0]),
            torch.zeros(*shape, 3, device=blocks.device),
            unseen,
            -unseen,
            torch.zeros(*shape, 5 + anchors, device=blocks.device),
        )

    def new_pixels(
        self, blocks: Bool[Tensor, "b b"], side: int, stride: int, size: int
    ) -> tuple[Int[Tensor, " P"], Int[Tensor, " P"]]:
        """Rows and columns of the window at every stride-th pixel, less those at every second one.

        Args:
            blocks: of the frame that are rendered.
            side: of a block, the largest stride; at that stride no pixel is left out.
            stride: a divisor of it.
            size: side of the frame.
        """
        height, width = self.near.shape
        down, across = (torch.arange(0, n, stride, device=blocks.device) for n in (height, width))
        inside = [down + self.row < size, across + self.column < size]
        some = blocks[
            ((down + self.row) // side).clamp_max(len(blocks) - 1)[:, None],
            ((across + self.column) // side).clamp_max(len(blocks) - 1),
        ]
        some = some & inside[0][:, None] & inside[1]
        if stride < side:
            some[::2, ::2] = False
        rows, columns = some.nonzero(as_tuple=True)
        return rows * stride, columns * stride

    def surroundings(self, at: Pixels, stride: int) -> Surroundings:
        """Values for pixels at every stride-th row and column, from every second one."""
        known = self.surface[:: 2 * stride, :: 2 * stride]
        near, far = self.near[:: 2 * stride, :: 2 * stride], self.far[:: 2 * stride, :: 2 * stride]
        opacity, depth = known[..., OPACITY], known[..., DEPTH]
        residual = known[..., RESIDUAL].movedim(-1, 0)
        planes = torch.stack([-opacity, depth, -depth, -near, far])
        planes = torch.cat([planes, residual, -residual])
        extremes = F.max_pool2d(planes[None], 3, 1, 1)
        row, column = (i // (2 * stride) for i in at)
        faint, deep, shallow, nearest, furthest, *residuals = extremes[0, :, row, column]
        rough = torch.stack(residuals).view(2, 3, -1).sum(0).amax(0)
        below, beside = (i % (2 * stride) // stride for i in at)
        four = (known[row + i * below, column + j * beside] for i in (0, 1) for j in (0, 1))
        return Surroundings(
            sum(four, known.new_zeros(())) / 4,
            -nearest,
            furthest,
            (-faint > OPAQUE) & (deep + shallow < STEP) & (rough < ROUGH),
        )

    def frame(self, size: int) -> HeadImage:
        """Colour and opacity of a frame of size x size pixels, blank outside of the window."""
        colour = self.colour.new_zeros(size, size, 3)
        opacity = self.colour.new_zeros(size, size)
        rows, columns = slice(self.row, size), slice(self.column, size)
        inside = colour[rows, columns]
        height, width = (min(a, b) for a, b in zip(inside.shape, self.near.shape, strict=False))
        inside[:height, :width] = self.colour[:height, :width]
        opacity[rows, columns][:height, :width] = self.surface[:height, :width, OPACITY]
        return colour, opacity
