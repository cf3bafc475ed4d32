"""Training of the lip filter.

    python -m dubbing.workshop.training.lips.training CLIP... --out FILE

A ridge regression, minutes on one core. Faces are kept in a folder beside FILE, so a killed run
need not look for them again; the same seed gives the same filter.

Letters: F frames, T steps of 24 ms, C channels of the encoder, K = (2 TAPS + 1) C, H numbers heard.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer
from torch import Tensor

from dubbing.sound_to_lips.lip_network import FILTER_FORMAT, TAPS, LipFilter, load_encoder, save
from dubbing.workshop.training.lips.lip_clips import LipClip, lip_clips

STRENGTH = 1.0  # of the ridge, times the mean power of an input


def at_moments(values: Tensor, moments: np.ndarray) -> Tensor:
    """Values (T, ...) between steps, at moments (F,), linearly interpolated."""
    place = torch.from_numpy(moments).float().clamp(0, len(values) - 1)
    low = place.floor().long().clamp(max=max(0, len(values) - 2))
    share = (place - low)[:, None]
    return values[low] * (1 - share) + values[(low + 1).clamp(max=len(values) - 1)] * share


@torch.no_grad()
def fit(clips: Sequence[LipClip]) -> LipFilter:
    """The filter that gives lip measures and touching lips, each clip's less their means.

    Every frame counts the same, whatever the number of takes of its sound. The speech numbers come
    from the unchanged sounds.

    Raises:
        ValueError: there is no clip.
    """
    if not clips:
        raise ValueError("there is no clip to train on")
    network = LipFilter()
    sounds = torch.cat([clip.takes[0].encoded.float() for clip in clips])
    mean, spread = (part.repeat(2 * TAPS + 1) for part in statistics(sounds))
    square, product = torch.zeros(0), torch.zeros(0)
    for clip in clips:
        wanted = clip.targets() - clip.targets().mean(0)
        for take in clip.takes:
            x = (LipFilter.around(take.encoded.float()) - mean) / spread
            x = at_moments(x, take.moments(clip.times))
            x = (x - x.mean(0)) / len(clip.takes) ** 0.5
            scaled = wanted / len(clip.takes) ** 0.5
            square = square + x.T @ x if len(square) else x.T @ x
            product = product + x.T @ scaled if len(product) else x.T @ scaled
    square, product = square.double(), product.double()
    square.diagonal().add_(STRENGTH * square.diagonal().mean())
    weight = torch.linalg.solve(square, product) / spread[:, None]
    network.map.weight.copy_(weight.T)
    network.map.bias.copy_(-(mean.double() @ weight))
    components = principal_components(sounds, network.heard.out_features)
    network.heard.weight.copy_(components)
    network.heard.bias.copy_(-(components @ sounds.mean(0)))
    return network


def statistics(sounds: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (C,) of the encoder's outputs (T, C)."""
    return sounds.mean(0), sounds.std(0).clamp_min(1e-3)


def principal_components(sounds: Tensor, count: int) -> Tensor:
    """Directions (H, C) in which sounds (T, C) vary most, channels of one spread; variance 1 each.

    Args:
        count: H.
    """
    mean, spread = statistics(sounds)
    even = ((sounds - mean) / spread).double()
    variance, directions = torch.linalg.eigh(even.T @ even / len(even))
    first = (directions / variance.clamp_min(1e-9).sqrt())[:, -count:].flip(1)
    return (first.T / spread).float()


def main(
    clips: Annotated[list[Path], typer.Argument(exists=True, dir_okay=False)],
    out: Annotated[Path, typer.Option("--out", help="The weights to write.")],
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Train the lip filter on clips of one talking person each."""
    cache = out.with_name(out.name + ".faces")
    measured = lip_clips(clips, cache, load_encoder(), seed)
    about = {
        "clips": [clip.name for clip in measured],
        "frames": sum(len(clip.times) for clip in measured),
        "seed": seed,
    }
    save(fit(measured), out, FILTER_FORMAT, about)
    typer.echo(f"wrote {out}, from {len(measured)} clips")


if __name__ == "__main__":
    typer.run(main)
