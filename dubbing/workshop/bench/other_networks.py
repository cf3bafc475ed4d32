"""Networks of other tools, by the layers that were published, without their weights: to be timed.

Wav2Lip's generator (Prajwal et al., 2020); the U-Net and the decoder of Stable Diffusion 1 (Rombach
et al., 2022), which MuseTalk and LatentSync took over for another input and speech instead of text.
LatentSync has layers over time besides, which are left out here: its real time is longer.

B images, C channels, H and W rows and columns, N pixels or K speech vectors of D values.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

WHISPER, STEP_DIM = 384, 1280  # of the speech vectors of both tools; of the code of a step
# Channels of the U-Net; all but the last attend to the speech vectors.
LEVELS = (320, 640, 1280, 1280)
HEADS, GROUPS = 8, 32
attention = partial(nn.MultiheadAttention, batch_first=True)
conv = partial(nn.Conv2d, kernel_size=3, padding=1)


class Block(nn.Module):
    """A convolution as Wav2Lip's: normalised, then rectified; or its residual form."""

    def __init__(self, convolution: nn.Module, channels: int, residual: bool = False) -> None:
        super().__init__()
        self.layers = nn.Sequential(convolution, nn.BatchNorm2d(channels))
        self.residual = residual

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.layers(x) + x if self.residual else self.layers(x))


def blocks(*rows: tuple[Any, ...], up: bool = False) -> nn.Sequential:
    """Rows of C in, C out, kernel, stride, padding, how many residual ones of 3 x 3 follow."""
    layers: list[nn.Module] = []
    for before, after, kernel, stride, padding, residuals in rows:
        size = (before, after, kernel, stride, padding)
        first = nn.ConvTranspose2d(*size, stride - 1) if up else nn.Conv2d(*size)
        layers.append(Block(first, after))
        layers += [Block(conv(after, after), after, True) for _ in range(residuals)]
    return nn.Sequential(*layers)


class Wav2Lip(nn.Module):
    """Mel windows (B, 1, 80, 16) and faces (B, 6, 96, 96), half hidden: faces (B, 3, 96, 96)."""

    def __init__(self) -> None:
        super().__init__()
        self.sound = blocks(
            *((1, 32, 3, 1, 1, 2), (32, 64, 3, (3, 1), 1, 2), (64, 128, 3, 3, 1, 2)),
            *((128, 256, 3, (3, 2), 1, 1), (256, 512, 3, 1, 0, 0), (512, 512, 1, 1, 0, 0)),
        )
        down = [blocks((16 << k, 32 << k, 3, 2, 1, n)) for k, n in enumerate((2, 3, 2, 2, 1))]
        last = blocks((512, 512, 3, 1, 0, 0), (512, 512, 1, 1, 0, 0))
        self.down = nn.ModuleList([blocks((6, 16, 7, 1, 3, 0)), *down, last])
        rows = [(1024, 512, 3, 1, 0, 1), (1024, 512, 3, 2, 1, 2), (768, 384, 3, 2, 1, 2)]
        rows += [(512, 256, 3, 2, 1, 2), (320, 128, 3, 2, 1, 2), (160, 64, 3, 2, 1, 2)]
        first = blocks((512, 512, 1, 1, 0, 0))
        self.up = nn.ModuleList([first, *(blocks(row, up=True) for row in rows)])
        self.out = nn.Sequential(blocks((80, 32, 3, 1, 1, 0)), nn.Conv2d(32, 3, 1))

    def forward(self, mel: Tensor, faces: Tensor) -> Tensor:
        skipped = [faces]
        for layer in self.down:
            skipped.append(layer(skipped[-1]))
        x = self.sound(mel)
        for layer in self.up:
            x = torch.cat([layer(x), skipped.pop()], 1)
        return torch.sigmoid(self.out(x))


def normed(before: int, after: int) -> nn.Sequential:
    """One of what is normalised and bent before."""
    return nn.Sequential(nn.GroupNorm(GROUPS, before), nn.SiLU(), conv(before, after))


class Residual(nn.Module):
    """Two convolutions beside a straight way, which hear of the step where there are steps."""

    def __init__(self, before: int, after: int, steps: bool = True) -> None:
        super().__init__()
        self.first, self.second = normed(before, after), normed(after, after)
        self.step = nn.Sequential(nn.SiLU(), nn.Linear(STEP_DIM, after)) if steps else None
        self.straight = nn.Identity() if before == after else nn.Conv2d(before, after, 1)

    def forward(self, x: Tensor, step: Tensor | None = None) -> Tensor:
        h = self.first(x)
        if self.step is not None:
            h = h + self.step(step)[:, :, None, None]
        return torch.add(self.second(h), self.straight(x))


class Transformer(nn.Module):
    """Pixels (B, C, H, W) attend to one another and to the speech vectors (B, K, D)."""

    def __init__(self, channels: int, heard: int) -> None:
        super().__init__()
        self.enter = nn.Sequential(nn.GroupNorm(GROUPS, channels), nn.Conv2d(channels, channels, 1))
        self.norms = nn.ModuleList(nn.LayerNorm(channels) for _ in range(3))
        self.own = attention(channels, HEADS, bias=False)
        self.cross = attention(channels, HEADS, bias=False, kdim=heard, vdim=heard)
        self.wide = nn.Linear(channels, 8 * channels)
        self.narrow = nn.Linear(4 * channels, channels)
        self.leave = nn.Conv2d(channels, channels, 1)

    def forward(self, x: Tensor, heard: Tensor) -> Tensor:
        h = self.enter(x).flatten(2).transpose(1, 2)
        own = self.norms[0](h)
        h = h + self.own(own, own, own, need_weights=False)[0]
        h = h + self.cross(self.norms[1](h), heard, heard, need_weights=False)[0]
        value, gate = self.wide(self.norms[2](h)).chunk(2, -1)
        h = h + self.narrow(value * F.gelu(gate))
        return x + self.leave(h.transpose(1, 2).unflatten(2, x.shape[2:]))


class UNet(nn.Module):
    """Latents (B, C, H, W), a step's code (B, 320), speech vectors (B, K, D): (B, 4, H, W)."""

    def __init__(self, channels: int, heard: int = WHISPER) -> None:
        super().__init__()
        wide = LEVELS[0]
        code = nn.Linear(wide, STEP_DIM)
        self.step = nn.Sequential(code, nn.SiLU(), nn.Linear(STEP_DIM, STEP_DIM))
        self.enter, self.down, self.up = conv(channels, wide), nn.ModuleList(), nn.ModuleList()
        kept = [wide]
        for level, after in enumerate(LEVELS):
            attended = heard if level < 3 else 0
            self.down.extend([part(kept[-1], after, attended), part(after, after, attended)])
            kept += [after, after]
            if level < 3:
                self.down.append(nn.ModuleList([conv(after, after, stride=2)]))
                kept.append(after)
        last = after
        self.middle = nn.ModuleList([*part(last, last, heard), Residual(last, last)])
        for level, after in reversed([*enumerate(LEVELS)]):
            for k in range(3):
                layers = part(last + kept.pop(), after, heard if level < 3 else 0)
                if level and k == 2:
                    layers.extend([nn.Upsample(scale_factor=2), conv(after, after)])
                self.up.append(layers)
                last = after
        self.leave = normed(wide, 4)

    def forward(self, x: Tensor, code: Tensor, heard: Tensor) -> Tensor:
        step, kept = self.step(code), [self.enter(x)]
        for layers in self.down:
            kept.append(through(layers, kept[-1], step, heard))
        h = through(self.middle, kept[-1], step, heard)
        for layers in self.up:
            h = through(layers, torch.cat([h, kept.pop()], 1), step, heard)
        return torch.as_tensor(self.leave(h))


def part(before: int, after: int, heard: int) -> nn.ModuleList:
    """A residual block, and attention to the speech vectors where there are any."""
    layers: list[nn.Module] = [Residual(before, after)]
    return nn.ModuleList([*layers, Transformer(after, heard)] if heard else layers)


def through(layers: Any, x: Tensor, step: Tensor, heard: Tensor) -> Tensor:
    """Pixels through layers, each of which takes what it knows of."""
    for layer in layers:
        more = {Residual: (step,), Transformer: (heard,)}.get(type(layer), ())
        x = layer(x, *more)
    return x


class Alone(nn.Module):
    """Pixels (B, C, H, W) of a latent look at one another."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm = nn.GroupNorm(GROUPS, channels)
        self.own = attention(channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        h = self.norm(x).flatten(2).transpose(1, 2)
        h = self.own(h, h, h, need_weights=False)[0]
        return x + h.transpose(1, 2).unflatten(2, x.shape[2:])


def decoder() -> nn.Sequential:
    """Latents (B, 4, H, W) into images (B, 3, 8 H, 8 W)."""
    layers: list[nn.Module] = [nn.Conv2d(4, 4, 1), conv(4, 512), Residual(512, 512, False)]
    layers += [Alone(512), Residual(512, 512, False)]
    last = 512
    for after in (512, 512, 256, 128):
        layers += [Residual(k, after, False) for k in (last, after, after)]
        if after != 128:
            layers += [nn.Upsample(scale_factor=2), conv(after, after)]
        last = after
    return nn.Sequential(*layers, normed(128, 3))
