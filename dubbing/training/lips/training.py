"""Training of the lip network: `python -m dubbing.training.lips.training CLIP... --out FILE`.

Minutes on one core. Faces are kept in a folder beside FILE, so a killed run need not look for them
again; the same seed gives the same network.

Letters: B items, T steps of 20 ms, F frames, O outputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import torch.nn.functional as F
import typer
from torch import Tensor, nn
from tqdm import trange

from dubbing.sound_to_lips.network import CLOSED, MEASURES, LipNetwork, Member, Sizes
from dubbing.sound_to_lips.weights import save
from dubbing.speech.acoustic_weights import load_model
from dubbing.training.lips.closed_form import at_moments, fit_filters, said_by_others
from dubbing.training.lips.lessons import Lesson, lessons

STEPS = 150  # of 20 ms in an item
SLOWER = 0.12  # an item is stretched by up to this, as a logarithm
SPOILT_TAKES = 0.8  # share of the items heard in another take
NOISE = 0.1  # of the features' spread: in every step, and once for a whole item
COUNTED = 500  # frames of a clip from which on more are not drawn more often
# Share, in what the members learn, of what filters learned from other people say of the same
# frames: they cannot know a person's habits, so these are not learned. AGREEMENT is how far lips
# follow them.
TEACHER, AGREEMENT = 0.7, 0.6
# How much the measures count: the opening and the width are seen first.
WEIGHTS = (2.0, 0.7, 0.7, 2.0, 1.0, 1.0, 1.0)
# Shares of the losses beside the squared error.
CORRELATION, VELOCITY, OUTLINES, TOUCHING = 0.5, 0.3, 0.3, 0.3


@dataclass(frozen=True)
class LipTraining:
    """How long and how."""

    iterations: int = 400
    items: int = 24
    rate: float = 2e-3
    decay: float = 0.05
    seed: int = 0


@dataclass(frozen=True)
class Batch:
    """Features (B, T, D); moments (B, F) among the steps, targets (B, F, O), known (B, F)."""

    features: Tensor
    moments: Tensor
    targets: Tensor
    known: Tensor


def draw(
    found: Sequence[Lesson],
    activations: Sequence[list[Tensor]],
    items: int,
    rng: np.random.Generator,
) -> Batch:
    """Random stretches of random clips; `activations`: the features (T, D) of each clip's takes."""
    often = np.array([min(len(one.times), COUNTED) ** 0.5 for one in found])
    features, moments, targets = [], [], []
    for k in rng.choice(len(found), items, p=often / often.sum()):
        one = found[k]
        which = int(rng.integers(len(one.takes))) if rng.random() < SPOILT_TAKES else 0
        at = one.takes[which].moments(one.times)
        pace = float(np.exp(rng.uniform(-SLOWER, SLOWER)))
        first = rng.uniform(at[0] - 5, max(at[0], at[-1] - STEPS * pace) + 5)
        steps = first + np.arange(STEPS) * pace
        inside = torch.from_numpy((steps >= 0) & (steps < len(activations[k][which]) - 1)).float()
        features.append(at_moments(activations[k][which], steps) * inside[:, None])
        chosen = np.flatnonzero((at >= first) & (at < first + (STEPS - 2) * pace))
        moments.append(torch.from_numpy((at[chosen] - first) / pace).float())
        targets.append(one.targets()[chosen])
    padded = nn.utils.rnn.pad_sequence
    known = padded([torch.ones(len(m)) for m in moments], batch_first=True)
    return Batch(
        torch.stack(features),
        padded(moments, batch_first=True),
        padded(targets, batch_first=True),
        known,
    )


def read(answers: Tensor, moments: Tensor) -> Tensor:
    """Answers (B, T, O) at moments (B, F), (B, F, O)."""
    low = moments.floor().long().clamp(0, answers.shape[1] - 2)
    share = (moments - low)[..., None]

    def at(index: Tensor) -> Tensor:
        return answers.gather(1, index[..., None].expand(-1, -1, answers.shape[2]))

    return at(low) * (1 - share) + at(low + 1) * share


def loss_of(said: Tensor, batch: Batch) -> Tensor:
    """Squared error of measures, their correlation and velocity; outline; touching lips."""
    weight = torch.tensor(WEIGHTS) / sum(WEIGHTS)
    known, count = batch.known[..., None], batch.known.sum()
    lips, wanted = said[..., :MEASURES], batch.targets[..., :MEASURES]
    loss = (((lips - wanted) ** 2 * known).sum((0, 1)) / count * weight).sum()
    frames = known.sum(1, keepdim=True).clamp_min(2)
    a, b = ((x - (x * known).sum(1, keepdim=True) / frames) * known for x in (lips, wanted))
    power = ((a**2).sum(1) * (b**2).sum(1) + 1e-3).sqrt()
    loss = loss + CORRELATION * ((1 - (a * b).sum(1) / power) * weight).sum(-1).mean()
    moved = (lips - wanted).diff(dim=1) ** 2 * known[:, 1:]
    loss = loss + VELOCITY * (moved.sum((0, 1)) / count * weight).sum()
    beside = (said[..., CLOSED + 1 :] - batch.targets[..., CLOSED + 1 :]) ** 2 * known
    loss = loss + OUTLINES * (beside.sum((0, 1)) / count).mean()
    touching = F.binary_cross_entropy_with_logits(
        said[..., CLOSED], batch.targets[..., CLOSED], reduction="none"
    )
    return loss + TOUCHING * (touching * batch.known).sum() / count


def train_member(
    member: Member,
    found: Sequence[Lesson],
    activations: Sequence[list[Tensor]],
    settings: LipTraining,
) -> None:
    """AdamW with a one-cycle rate."""
    rng, made = np.random.default_rng(settings.seed), torch.Generator().manual_seed(settings.seed)
    member.train()
    optimiser = torch.optim.AdamW(
        member.parameters(), lr=settings.rate, weight_decay=settings.decay
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, settings.rate, total_steps=settings.iterations, pct_start=0.15
    )
    bar = trange(settings.iterations, desc=f"member {settings.seed}", mininterval=2)
    for _ in bar:
        batch = draw(found, activations, settings.items, rng)
        x = batch.features
        spread = NOISE * x.std()
        x = x + spread * torch.randn(x.shape, generator=made)
        x = x + spread * torch.randn(len(x), 1, x.shape[2], generator=made)
        loss = loss_of(read(member(x), batch.moments), batch)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(member.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        bar.set_postfix(loss=f"{loss.item():.3f}", refresh=False)
    member.eval()


def train(
    found: Sequence[Lesson], settings: LipTraining | None = None, sizes: Sizes | None = None
) -> LipNetwork:
    """A network taught by all lessons."""
    settings = settings or LipTraining()
    model = load_model()
    torch.manual_seed(settings.seed)
    network = LipNetwork(model.projection, model.silence, sizes)
    with torch.no_grad():
        taught = tuple(
            replace(one, lips=TEACHER * AGREEMENT * said.numpy() + (1 - TEACHER) * one.lips)
            for one, said in zip(found, said_by_others(network, found), strict=True)
        )
        fit_filters(network, found)
        activations = [
            [network.inputs(t.activations.float(), t.voice.float())[2] for t in one.takes]
            for one in found
        ]
    for k, member in enumerate(network.members):
        own = LipTraining(**{**settings.__dict__, "seed": settings.seed + k})
        torch.manual_seed(own.seed)
        assert isinstance(member, Member)
        train_member(member, taught, activations, own)
    balance(network.eval(), found)
    return network


@torch.no_grad()
def balance(network: LipNetwork, found: Sequence[Lesson]) -> None:
    """Scales the parts' answers to the same spread over all lessons, that of the filters."""
    spread = []
    for one in found:
        take = one.takes[0]
        parts = network.parts(take.activations.float()[None], take.voice.float()[None])
        spread.append(torch.stack([p[0].std(0) for p in parts]))
    mean_spread = torch.stack(spread).mean(0)
    network.scale.copy_(mean_spread[:1] / mean_spread.clamp_min(1e-6))


def main(
    clips: Annotated[list[Path], typer.Argument(exists=True, dir_okay=False)],
    out: Annotated[Path, typer.Option("--out", help="The weights to write.")],
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Teach the lip network by clips of one talking person each."""
    settings = LipTraining(seed=seed)
    cache = out.with_name(out.name + ".faces")
    found = lessons(clips, cache, load_model(), seed)
    network = train(found, settings)
    about: dict[str, Any] = {
        "clips": [one.name for one in found],
        "frames": sum(len(one.times) for one in found),
        "settings": settings.__dict__,
    }
    save(network, out, about)
    typer.echo(f"wrote {out}, from {len(found)} clips")


if __name__ == "__main__":
    typer.run(main)
