"""Training of the acoustic network: half an hour on one core, resumed exactly after a kill."""

import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from dubbing.engine.disk.files import atomic_path
from dubbing.errors import TrainingError
from dubbing.speech.acoustic_network import AcousticNetwork
from dubbing.speech.acoustic_weights import save_model
from dubbing.speech.voice_activity import SAMPLE_RATE
from dubbing.workshop.training.speech.augmentation import Batches
from dubbing.workshop.training.speech.corpus import Amounts, Part, Progress, build_corpus
from dubbing.workshop.training.speech.losses import losses
from dubbing.workshop.training.speech.projection import project

RATE = 2e-3
WARM_UP = 0.1
DECAY = 0.02
# Nats of senones, nats of phones, squared error of the lips.
LOSS_WEIGHTS = (1.0, 0.5, 2.0)
SAVED_EVERY = 100
STATE = "state.pt"


@dataclass(frozen=True)
class SpeechTraining:
    """How long, and on how much."""

    steps: int = 1400
    seed: int = 0
    amounts: Amounts = field(default_factory=Amounts)


def train_network(
    parts: Sequence[Part], settings: SpeechTraining, resume: Path, progress: Progress
) -> AcousticNetwork:
    """AdamW with a one-cycle rate; `resume` is a folder for the state of an interrupted run.

    Raises:
        TrainingError: the state there is of a run with other settings, or the loss diverged.
    """
    torch.manual_seed(settings.seed)
    network = AcousticNetwork()
    batches = Batches(parts, np.random.default_rng(settings.seed))
    optimiser = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
    rates = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, settings.steps, pct_start=WARM_UP)
    about = asdict(settings) | {"parts": [part.name for part in parts]}
    learner = {"network": network, "optimiser": optimiser, "rates": rates}
    first = _restore(resume / STATE, about, learner, batches)
    network.train()
    for step in range(first, settings.steps):
        batch = batches.draw()
        outputs = network(batch.spectra)
        each = losses(outputs, batch.senones, batch.phones, batch.lips, batch.known)
        loss = (torch.stack(each) * torch.tensor(LOSS_WEIGHTS)).sum()
        if not torch.isfinite(loss):
            raise TrainingError("the loss is no number", f"step {step}", "change the seed")
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        rates.step()
        done = step + 1
        if done % 20 == 0:
            loss_text = ", ".join(f"{part.item():.3f}" for part in each)
            progress(f"step {done} of {settings.steps}: {loss_text}", done / settings.steps)
        if done % SAVED_EVERY == 0 and done < settings.steps:
            _save(resume / STATE, about, done, learner, batches)
    shutil.rmtree(resume, ignore_errors=True)
    return network.eval()


def _save(
    file: Path, about: dict[str, Any], step: int, learner: dict[str, Any], batches: Batches
) -> None:
    """Write the state of a run; of a learner, what changes in each of its parts."""
    file.parent.mkdir(parents=True, exist_ok=True)
    state = {
        "about": about,
        "step": step,
        **{name: part.state_dict() for name, part in learner.items()},
        "torch": torch.get_rng_state(),
        "numpy": batches.rng.bit_generator.state,
    }
    with atomic_path(file) as temporary:
        torch.save(state, temporary)


def _restore(file: Path, about: dict[str, Any], learner: dict[str, Any], batches: Batches) -> int:
    """The step to go on from: 0 without a state."""
    if not file.exists():
        return 0
    state = torch.load(file, weights_only=True)
    if state["about"] != about:
        raise TrainingError(
            "an interrupted training with other settings lies here",
            str(file.parent),
            "finish it with its own settings, or delete that folder",
        )
    for name, part in learner.items():
        part.load_state_dict(state[name])
    torch.set_rng_state(state["torch"])
    batches.rng.bit_generator.state = state["numpy"]
    return int(state["step"])


def train_speech(
    recordings: Sequence[Path],
    out: Path,
    *,
    corpus: Path,
    settings: SpeechTraining | None = None,
    progress: Progress,
) -> dict[str, Any]:
    """Builds the corpus, trains the network and writes its weights: everything from nothing.

    Args:
        recordings: sounds or videos of people speaking, taught by the teacher alone; may be none.
        out: the weights. Beside it, OUT.resume holds the state of an interrupted run.
        corpus: folder for sounds and what is known of them; what lies there is used again.
        progress: called with a message and the share done of the step at hand.

    Returns:
        the `about` of the weights' header.

    Raises:
        TrainingError: flite or pocketsphinx is missing, or another run was interrupted here.
        MediaError: a recording cannot be read.
    """
    settings = settings or SpeechTraining()
    parts = build_corpus(corpus, recordings, settings.amounts, settings.seed, progress)
    network = train_network(parts, settings, out.with_name(out.name + ".resume"), progress)
    about = {
        "voices": [part.name for part in parts if not part.real],
        "recordings": [part.name for part in parts if part.real],
        "seconds": round(sum(len(u.samples) for p in parts for u in p.utterances) / SAMPLE_RATE),
        **asdict(settings),
    }
    save_model(project(network, parts), out, about)
    return about
