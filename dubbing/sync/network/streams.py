"""The streams of one member: mouth and sound, each to one embedding.

Letters: B items, V = 5 mouth frames, M mouth points, R rows and C columns of a crop, K components,
A = 10 sound steps of 20 ms, E embedding size.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS
from dubbing.face.mouth.mouth_shape import MOUTH

# Five frames of the 25 fps the network was made for; other rates are interpolated to it.
MOUTH_FRAMES = 5
MOUTH_STEP = 0.04
SOUND_STEPS = 10
WIDTH = 128
SIZE = 64
_COMPONENTS = 16
_MAPS = (24, 48, 64)
# Deviation of the logarithms of `channels.relative` is about a third.
_PIXEL_SCALE = 3.0


class LipStream(nn.Module):
    """Aligned lip geometry, through its principal directions (`basis`)."""

    basis: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("basis", torch.zeros(2 * len(MOUTH), _COMPONENTS))
        self.layers = nn.Sequential(
            nn.Linear(MOUTH_FRAMES * _COMPONENTS, WIDTH),
            nn.LayerNorm(WIDTH),
            nn.GELU(),
            nn.Dropout(0.1),
            nn.Linear(WIDTH, WIDTH),
            nn.LayerNorm(WIDTH),
            nn.GELU(),
            nn.Dropout(0.1),
            nn.Linear(WIDTH, SIZE),
        )

    def forward(self, shapes: Float[Tensor, "B V 2*M"]) -> Float[Tensor, "B E"]:
        embedding: Tensor = self.layers((shapes @ self.basis).flatten(1))
        return embedding


class PixelStream(nn.Module):
    """Grey crops of the mouth; the five frames are the channels of the first convolution.

    Items are not normalised by their own contrast: a mouth that moves little must count little.
    """

    def __init__(self) -> None:
        super().__init__()
        first, second, third = _MAPS
        # Three halvings, rounded up: 36 x 48 becomes 5 x 6.
        joined = third * -(-ROWS // 8) * -(-COLUMNS // 8)
        self.layers = nn.Sequential(
            nn.Conv2d(MOUTH_FRAMES, first, 5, 2, 2),
            nn.BatchNorm2d(first),
            nn.GELU(),
            nn.Conv2d(first, second, 3, 2, 1),
            nn.BatchNorm2d(second),
            nn.GELU(),
            nn.Conv2d(second, third, 3, 2, 1),
            nn.BatchNorm2d(third),
            nn.GELU(),
            nn.Flatten(),
            nn.Dropout(0.2),
            nn.Linear(joined, WIDTH),
            nn.GELU(),
            nn.Dropout(0.1),
            nn.Linear(WIDTH, SIZE),
        )

    def forward(self, pixels: Float[Tensor, "B V R*C"]) -> Float[Tensor, "B E"]:
        crops = pixels.unflatten(2, (ROWS, COLUMNS))
        embedding: Tensor = self.layers(crops * _PIXEL_SCALE)
        return embedding


class SoundStream(nn.Module):
    """Channels of one kind over 0.2 s."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        # Two valid convolutions of three steps leave SOUND_STEPS - 4.
        joined = WIDTH * (SOUND_STEPS - 4)
        self.layers = nn.Sequential(
            nn.Conv1d(channels, WIDTH, 3),
            nn.GELU(),
            nn.Dropout(0.1),
            nn.Conv1d(WIDTH, WIDTH, 3),
            nn.GELU(),
            nn.Flatten(),
            nn.LayerNorm(joined),
            nn.Dropout(0.1),
            nn.Linear(joined, WIDTH),
            nn.GELU(),
            nn.Linear(WIDTH, SIZE),
        )

    def forward(self, sound: Float[Tensor, "B A D"]) -> Float[Tensor, "B E"]:
        embedding: Tensor = self.layers(sound.transpose(1, 2))
        return embedding
