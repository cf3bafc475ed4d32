"""LPIPS: the perceptual distance of two images.

Zhang et al., *The Unreasonable Effectiveness of Deep Features as a Perceptual Metric* (CVPR 2018),
AlexNet, version 0.1. The heads ship with the code (LPIPS_CARD.md), AlexNet is the user's own: the
modules are laid out so that the tensor names of both files fit.

H, W are the sides of an image, C the channels of a layer.
"""

from __future__ import annotations

from pathlib import Path
from pickle import UnpicklingError

import torch
from jaxtyping import Float
from safetensors.torch import load_file
from torch import Tensor, nn

from dfrf.checkpoint import CheckpointError

CHANNELS = (64, 192, 384, 256, 256)
SHIFT = (-0.030, -0.088, -0.188)
SCALE = (0.458, 0.448, 0.450)
EPSILON = 1e-10
HEADS = Path(__file__).with_name("lpips_heads.safetensors")
REMEDY = "give torchvision's AlexNet (alexnet-owt-7be5be79.pth)"


class Lpips(nn.Module):
    """The distance of two images: 0 for equal ones, smaller for more similar ones."""

    shift: Tensor
    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Sequential(
            *(nn.Conv2d(3, CHANNELS[0], 11, stride=4, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
            *(nn.Conv2d(CHANNELS[0], CHANNELS[1], 5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
            *(nn.Conv2d(CHANNELS[1], CHANNELS[2], 3, padding=1), nn.ReLU()),
            *(nn.Conv2d(CHANNELS[2], CHANNELS[3], 3, padding=1), nn.ReLU()),
            *(nn.Conv2d(CHANNELS[3], CHANNELS[4], 3, padding=1), nn.ReLU()),
        )
        self.lin0, self.lin1, self.lin2, self.lin3, self.lin4 = map(_head, CHANNELS)
        shape = (3, 1, 1)
        self.register_buffer("shift", torch.tensor(SHIFT).view(shape), persistent=False)
        self.register_buffer("scale", torch.tensor(SCALE).view(shape), persistent=False)

    @torch.no_grad()
    def forward(self, image: Float[Tensor, "H W 3"], truth: Float[Tensor, "H W 3"]) -> float:
        """Distance of two images in 0..1, at least 31 px a side."""
        here = self.shift.device
        x = torch.stack([image, truth]).permute(0, 3, 1, 2).to(here, torch.float32) * 2 - 1
        x = (x - self.shift) / self.scale
        heads = iter((self.lin0, self.lin1, self.lin2, self.lin3, self.lin4))
        distance = 0.0
        for layer in self.features:
            x = layer(x)
            if isinstance(layer, nn.ReLU):
                unit = x / (x.square().sum(1, keepdim=True).sqrt() + EPSILON)
                difference = (unit[:1] - unit[1:]).square()
                distance += float(next(heads)["model"](difference).mean())
        return distance


def _head(channels: int) -> nn.ModuleDict:
    """Weights of the channels of a layer; in training, dropout came before them."""
    weights = nn.Conv2d(channels, 1, 1, bias=False)
    return nn.ModuleDict({"model": nn.Sequential(nn.Identity(), weights)})


def load(file: Path, device: torch.device) -> Lpips:
    """The distance with published weights; AlexNet's come from a file on the user's disk.

    Args:
        file: the state dict of torchvision's AlexNet.

    Raises:
        CheckpointError: the file is no state dict, or one of another network.
    """
    try:
        alexnet = torch.load(file, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, ValueError, EOFError, UnpicklingError) as error:
        # UnpicklingError: anything but plain tensors is refused, whatever it would do.
        raise CheckpointError(f"{file}: weights cannot be read; {REMEDY}") from error
    if not isinstance(alexnet, dict):
        raise CheckpointError(f"{file}: not a state dict; {REMEDY}")
    # The layers of the classifier are not used.
    kept = {name: value for name, value in alexnet.items() if str(name).startswith("features.")}
    network = Lpips()
    try:
        network.load_state_dict({**kept, **load_file(HEADS)})
    except RuntimeError as error:
        missing = [
            name for name in network.features.state_dict(prefix="features.") if name not in kept
        ]
        what = f"no {missing[0]} in it" if missing else "tensors of another network"
        raise CheckpointError(f"{file}: {what}; {REMEDY}") from error
    return network.to(device).eval()
