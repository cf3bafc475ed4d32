"""The network of the published SyncNet (Chung & Zisserman 2016), for weights a user has.

Modules are laid out so that the tensor names of `syncnet_v2.model` fit, in its order. Ours is in
sync_network.py.

Letters: B windows, E = 1024 embedding size.
"""

from pathlib import Path
from pickle import UnpicklingError

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dubbing.errors import SyncError

EMBEDDING = 1024
FRAMES = 5
SIDE = 224
COEFFICIENTS = 13
STEPS = 20


def _sound_block(inputs: int, outputs: int, kernel: tuple[int, int], pad: int) -> list[nn.Module]:
    convolution = nn.Conv2d(inputs, outputs, kernel, padding=pad)
    return [convolution, nn.BatchNorm2d(outputs), nn.ReLU()]


def _mouth_block(
    inputs: int,
    outputs: int,
    kernel: tuple[int, int, int],
    stride: tuple[int, int, int] = (1, 1, 1),
    pad: tuple[int, int, int] = (0, 0, 0),
) -> list[nn.Module]:
    convolution = nn.Conv3d(inputs, outputs, kernel, stride, pad)
    return [convolution, nn.BatchNorm3d(outputs), nn.ReLU()]


def _head() -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(512, 512), nn.BatchNorm1d(512), nn.ReLU(), nn.Linear(512, EMBEDDING)
    )


class PublishedSyncNet(nn.Module):
    """Two streams: 13 MFCC x 20 steps, and 5 frames of 224 x 224 BGR in 0..255."""

    def __init__(self) -> None:
        super().__init__()
        self.netcnnaud = nn.Sequential(
            *_sound_block(1, 64, (3, 3), 1),
            nn.MaxPool2d((1, 1), (1, 1)),
            *_sound_block(64, 192, (3, 3), 1),
            nn.MaxPool2d((3, 3), (1, 2)),
            *_sound_block(192, 384, (3, 3), 1),
            *_sound_block(384, 256, (3, 3), 1),
            *_sound_block(256, 256, (3, 3), 1),
            nn.MaxPool2d((3, 3), (2, 2)),
            *_sound_block(256, 512, (5, 4), 0),
        )
        self.netfcaud = _head()
        self.netfclip = _head()
        self.netcnnlip = nn.Sequential(
            *_mouth_block(3, 96, (5, 7, 7), (1, 2, 2)),
            nn.MaxPool3d((1, 3, 3), (1, 2, 2)),
            *_mouth_block(96, 256, (1, 5, 5), (1, 2, 2), (0, 1, 1)),
            nn.MaxPool3d((1, 3, 3), (1, 2, 2), (0, 1, 1)),
            *_mouth_block(256, 256, (1, 3, 3), pad=(0, 1, 1)),
            *_mouth_block(256, 256, (1, 3, 3), pad=(0, 1, 1)),
            *_mouth_block(256, 256, (1, 3, 3), pad=(0, 1, 1)),
            nn.MaxPool3d((1, 3, 3), (1, 2, 2)),
            *_mouth_block(256, 512, (1, 6, 6)),
        )

    def embed_sound(self, mfcc: Float[Tensor, "B 1 13 20"]) -> Float[Tensor, "B E"]:
        return self.netfcaud(self.netcnnaud(mfcc).flatten(1))

    def embed_mouth(self, frames: Float[Tensor, "B 3 5 224 224"]) -> Float[Tensor, "B E"]:
        return self.netfclip(self.netcnnlip(frames).flatten(1))


def load_published(path: Path) -> PublishedSyncNet:
    """The published network in evaluation mode, from a state dict on the user's disk.

    Raises:
        SyncError: the file is missing, no state dict, or not of this network.
    """
    remedy = "give the published syncnet_v2.model, or leave the option out to use our network"
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, ValueError, EOFError, UnpicklingError) as error:
        # UnpicklingError: anything but plain tensors is refused, whatever it would do.
        raise SyncError("weights cannot be read", str(path), remedy) from error
    if not isinstance(state, dict):
        raise SyncError("not a state dict", str(path), remedy)
    network = PublishedSyncNet()
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        raise SyncError("these weights are of another network", str(path), remedy) from error
    return network.eval()
