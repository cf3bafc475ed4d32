"""Our two-stream network: a mouth and a sound that belong together lie close together.

The shape is that of SyncNet (Chung & Zisserman 2016): five frames of mouth against 0.2 s of
speech, one embedding each. The mouth is its aligned lip geometry, not its pixels. Each member
hears one part of the channels of `hearing`: log-mel, or what a recurrent network says is spoken.

Letters: B items, V = 5 mouth frames, M mouth points, K components, A = 10 sound steps of 20 ms,
D = 144 channels, E embedding size, N members.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from dubbing.errors import SyncError
from dubbing.features import fingerprint
from dubbing.shipped_weights import load_float, save_half
from dubbing.sync.hearing import CHANNELS
from dubbing.sync.mouth import MOUTH, RIGID

# Five frames of the 25 fps the network was made for; other rates are interpolated to it.
MOUTH_FRAMES = 5
MOUTH_STEP = 0.04
SOUND_STEPS = 10
FORMAT = "dfrf-sync-2"
DEFAULT_WEIGHTS = Path(__file__).with_name("weights.safetensors")
# Centre and scale: log-mel is 0 in silence and 1 in average speech, and comes to -1.4..1.2.
_LEVELS = {"mel": (0.7, 2.0), "rnn": (0.0, 1.0)}


class TwoStream(nn.Module):
    """One pair of streams; both embeddings have length 1."""

    basis: Tensor

    def __init__(
        self, hears: str = "mel", components: int = 16, width: int = 128, size: int = 64
    ) -> None:
        """`hears` is a key of `hearing.CHANNELS`."""
        super().__init__()
        self.hears = hears
        part = CHANNELS[hears]
        self.register_buffer("basis", torch.zeros(2 * len(MOUTH), components))
        self.mouth = nn.Sequential(
            nn.Linear(MOUTH_FRAMES * components, width),
            nn.LayerNorm(width),
            nn.GELU(),
            nn.Dropout(0.1),
            nn.Linear(width, width),
            nn.LayerNorm(width),
            nn.GELU(),
            nn.Dropout(0.1),
            nn.Linear(width, size),
        )
        # Two valid convolutions of three steps leave SOUND_STEPS - 4.
        joined = width * (SOUND_STEPS - 4)
        self.sound = nn.Sequential(
            nn.Conv1d(part.stop - part.start, width, 3),
            nn.GELU(),
            nn.Dropout(0.1),
            nn.Conv1d(width, width, 3),
            nn.GELU(),
            nn.Flatten(),
            nn.LayerNorm(joined),
            nn.Dropout(0.1),
            nn.Linear(joined, width),
            nn.GELU(),
            nn.Linear(width, size),
        )
        # Inverse temperature of the contrastive loss, as a logarithm; starts at 10.
        self.sharpness = nn.Parameter(torch.tensor(2.3))

    def embed_mouth(self, shapes: Float[Tensor, "B V M2"]) -> Float[Tensor, "B E"]:
        return F.normalize(self.mouth((shapes @ self.basis).flatten(1)), dim=1)

    def embed_sound(self, sound: Float[Tensor, "B A D"]) -> Float[Tensor, "B E"]:
        centre, scale = _LEVELS[self.hears]
        scaled = (sound[..., CHANNELS[self.hears]] - centre) * scale
        return F.normalize(self.sound(scaled.transpose(1, 2)), dim=1)

    def loss(self, mouth: Float[Tensor, "B V M2"], sound: Float[Tensor, "B A D"]) -> Tensor:
        """InfoNCE both ways (van den Oord et al. 2018): item b's sound is b's, all others not."""
        alike = self.embed_mouth(mouth) @ self.embed_sound(sound).T * self.sharpness.exp()
        own = torch.arange(len(alike), device=alike.device)
        return (F.cross_entropy(alike, own) + F.cross_entropy(alike.T, own)) / 2


class SyncNetwork(nn.Module):
    """Members that hear different things, and the canonical face their mouths are laid on.

    Embeddings of the members stand one after the other, divided by sqrt(N): the squared distance
    of two of them is the mean of the members' squared distances, 0..4.
    """

    face: Tensor

    def __init__(self, hears: Sequence[str]) -> None:
        """`hears` names what each member hears, keys of `hearing.CHANNELS`."""
        super().__init__()
        self.register_buffer("face", torch.zeros(len(RIGID), 3))
        self.members = nn.ModuleList(TwoStream(part) for part in hears)

    def _joined(self, parts: list[Tensor]) -> Tensor:
        return torch.cat(parts, 1) / len(parts) ** 0.5

    def embed_mouth(self, shapes: Float[Tensor, "B V M2"]) -> Float[Tensor, "B NE"]:
        """Shapes: mouth points of `mouth_shape` less their mean over the track."""
        return self._joined([member.embed_mouth(shapes) for member in self.pairs()])

    def embed_sound(self, sound: Float[Tensor, "B A D"]) -> Float[Tensor, "B NE"]:
        """Sound: what `Hearing` makes of 0.2 s around the same moment."""
        return self._joined([member.embed_sound(sound) for member in self.pairs()])

    def pairs(self) -> list[TwoStream]:
        return [m for m in self.members if isinstance(m, TwoStream)]


def save_network(network: SyncNetwork, path: Path, about: dict[str, Any]) -> None:
    """Weights in half precision; what they hear and were made from in the header."""
    header = {
        "format": FORMAT,
        "hears": ",".join(member.hears for member in network.pairs()),
        "acoustics": fingerprint("rnn"),
        "about": json.dumps(about),
    }
    save_half(network.state_dict(), path, header)


def load_network(path: Path = DEFAULT_WEIGHTS) -> SyncNetwork:
    """The network in evaluation mode, float32.

    Raises:
        SyncError: the file is missing, damaged, holds something else, or listens to an acoustic
            network that is not there.
    """
    remedy = "make one with 'dfrf train-sync', or leave the option out to use ours"
    tensors, header = load_float(path, FORMAT, "sync", remedy, SyncError)
    if header.get("acoustics") != fingerprint("rnn"):
        raise SyncError("made for other weights of the acoustic network", str(path), remedy)
    network = SyncNetwork(header["hears"].split(","))
    network.load_state_dict(tensors)
    return network.eval()
