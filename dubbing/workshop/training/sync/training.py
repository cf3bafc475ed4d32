"""Training of our sync network: minutes a member on one core."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from dubbing.errors import SyncError
from dubbing.face.mouth.mouth_shape import canonical_face
from dubbing.sync.network.streams import LipStream
from dubbing.sync.network.sync_network import MemberInputs, SyncNetwork, TwoStream, save_network
from dubbing.workshop.training.sync.batches import Batches
from dubbing.workshop.training.sync.clips import TalkingClip, laid_on, record
from dubbing.workshop.training.sync.correlation import TRUSTED_PEAK, align, lip_basis
from dubbing.workshop.training.sync.speakers import TRAINING_SPEAKERS, Part, speaker_clips

RATE = 2e-3
WARM_UP = 0.1
DECAY = 0.05
MIN_CLIPS = 3

MEMBERS = (MemberInputs("lips", "mel"), MemberInputs("lips", "rnn"), MemberInputs("pixels", "mel"))
# A step of a member that sees pixels takes five times as long: it makes this share of them.
PIXEL_STEPS = 1 / 3

Log = Callable[[str], None]


@dataclass(frozen=True)
class SyncTraining:
    """How long and how often. `steps` are those of a member that sees lips."""

    steps: int = 1200
    members: tuple[MemberInputs, ...] = MEMBERS
    takes: int = 8  # other takes of every sound
    speakers: tuple[Part, ...] = TRAINING_SPEAKERS  # the synthetic ones that set the zero
    seed: int = 0

    def steps_of(self, inputs: MemberInputs) -> int:
        return round(self.steps * (PIXEL_STEPS if inputs.mouth == "pixels" else 1))


def usable_clips(clips: Sequence[TalkingClip]) -> list[TalkingClip]:
    """The clips with their own offsets corrected; those without a clear one are left out."""
    aligned, peaks = align(clips)
    return [c for c, p in zip(aligned, peaks, strict=True) if p >= TRUSTED_PEAK]


def train_member(
    clips: Sequence[TalkingClip],
    inputs: MemberInputs,
    steps: int,
    seed: int,
    log: Log | None = None,
) -> TwoStream:
    """One pair of streams, by InfoNCE with AdamW and a one-cycle rate."""
    torch.manual_seed(seed)
    member = TwoStream(inputs)
    if isinstance(member.mouth, LipStream):
        basis = member.mouth.basis
        basis.copy_(torch.from_numpy(lip_basis(clips, basis.shape[1])))
    batches = Batches(clips, inputs.mouth, np.random.default_rng(seed))
    optimiser = torch.optim.AdamW(member.parameters(), lr=RATE, weight_decay=DECAY)
    rates = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, steps, pct_start=WARM_UP)
    member.train()
    for step in range(steps):
        loss = member.loss(*batches.draw())
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        rates.step()
        if log is not None and (step + 1) % 100 == 0:
            what = f"{inputs.mouth} against {inputs.sound}, seed {seed}"
            log(f"{what}: step {step + 1} of {steps}, loss {loss.item():.3f}")
    return member.eval()


def train_network(
    clips: Sequence[TalkingClip], face: np.ndarray, settings: SyncTraining, log: Log | None = None
) -> SyncNetwork:
    """The network of several members, from clips whose offsets are corrected."""
    network = SyncNetwork(())
    network.face.copy_(torch.from_numpy(face))
    for k, inputs in enumerate(settings.members):
        seed, steps = settings.seed + k, settings.steps_of(inputs)
        network.members.append(train_member(clips, inputs, steps, seed, log))
    return network.eval()


def train_sync(
    clips: Sequence[Path],
    out: Path,
    *,
    settings: SyncTraining | None = None,
    log: Log | None = None,
) -> dict[str, Any]:
    """Trains the sync network on clips of one talking person each and writes its weights.

    Returns:
        the `about` of the weights' header: clips used with their own offsets in seconds
        (positive: the sound is late), clips left out, settings.

    Raises:
        SyncError: fewer than three clips, or fewer than three whose sound fits their mouth.
    """
    settings = settings or SyncTraining()
    if len(clips) < MIN_CLIPS:
        raise SyncError(
            f"{len(clips)} clips are too few", remedy=f"give {MIN_CLIPS} people or more"
        )
    recordings = [record(path) for path in clips]
    face = canonical_face(r.meshes for r in recordings)
    takes, seed = settings.takes, settings.seed
    measured = laid_on(recordings, face, takes=takes, seed=seed)
    with tempfile.TemporaryDirectory() as folder:
        synthetic = [record(p) for p in speaker_clips(Path(folder), settings.speakers, log)]
        measured += laid_on(synthetic, face, takes=takes, seed=seed + 1, exact=True)
    used = usable_clips(measured)
    if len(used) < MIN_CLIPS:
        raise SyncError(
            "too few clips whose sound fits the mouth",
            ", ".join(path.name for path in clips),
            "give more clips of people who speak to the camera",
        )
    names = {clip.name for clip in used}
    about = {
        "clips": {clip.name: round(clip.offset, 3) for clip in used},
        "left_out": sorted(clip.name for clip in measured if clip.name not in names),
        "steps": settings.steps,
        "members": [f"{sees} against {hears}" for sees, hears in settings.members],
        "seed": settings.seed,
    }
    save_network(train_network(used, face, settings, log), out, about)
    return about
