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

from dubbing.sound_to_lips.lip_network import TAPS, LipFilter
from dubbing.sound_to_lips.weights import FILTER_FORMAT, load_encoder, save
from dubbing.workshop.training.lips.lessons import Lesson, lessons

STRENGTH = 1.0  # of the ridge, times the mean power of an input


def at_moments(values: Tensor, moments: np.ndarray) -> Tensor:
    """Values (T, ...) between steps, at moments (F,), straight from one to the next."""
    place = torch.from_numpy(moments).float().clamp(0, len(values) - 1)
    low = place.floor().long().clamp(max=max(0, len(values) - 2))
    share = (place - low)[:, None]
    return values[low] * (1 - share) + values[(low + 1).clamp(max=len(values) - 1)] * share


@torch.no_grad()
def fit(found: Sequence[Lesson]) -> LipFilter:
    """The filter that gives lip measures and touching lips, each clip's less their means.

    Every frame counts the same, whatever the number of takes of its sound. What is heard is taken
    from the clips as they are.

    Raises:
        ValueError: there is no lesson.
    """
    if not found:
        raise ValueError("there is no lesson to learn from")
    made = LipFilter()
    sounds = torch.cat([one.takes[0].encoded.float() for one in found])
    mean, spread = (part.repeat(2 * TAPS + 1) for part in statistics(sounds))
    square, product = torch.zeros(0), torch.zeros(0)
    for one in found:
        wanted = one.targets() - one.targets().mean(0)
        for take in one.takes:
            x = (LipFilter.around(take.encoded.float()) - mean) / spread
            x = at_moments(x, take.moments(one.times))
            x = (x - x.mean(0)) / len(one.takes) ** 0.5
            scaled = wanted / len(one.takes) ** 0.5
            square = square + x.T @ x if len(square) else x.T @ x
            product = product + x.T @ scaled if len(product) else x.T @ scaled
    square, product = square.double(), product.double()
    square.diagonal().add_(STRENGTH * square.diagonal().mean())
    weight = torch.linalg.solve(square, product) / spread[:, None]
    made.map.weight.copy_(weight.T)
    made.map.bias.copy_(-(mean.double() @ weight))
    components = principal_components(sounds, made.heard.out_features)
    made.heard.weight.copy_(components)
    made.heard.bias.copy_(-(components @ sounds.mean(0)))
    return made


def statistics(sounds: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and spread (C,) of what the encoder gives for sounds (T, C)."""
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
    """Teach the lip filter by clips of one talking person each."""
    cache = out.with_name(out.name + ".faces")
    found = lessons(clips, cache, load_encoder(), seed)
    about = {
        "clips": [one.name for one in found],
        "frames": sum(len(one.times) for one in found),
        "seed": seed,
    }
    save(fit(found), out, FILTER_FORMAT, about)
    typer.echo(f"wrote {out}, from {len(found)} clips")


if __name__ == "__main__":
    typer.run(main)
