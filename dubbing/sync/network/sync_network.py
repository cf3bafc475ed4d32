"""Our two-stream sync network: a mouth and a sound that belong together have close embeddings.

The shape is that of SyncNet (Chung & Zisserman 2016): five frames of mouth against 0.2 s of speech,
one embedding each. Each member takes one kind of mouth channels, aligned lip geometry or aligned
pixels, and one kind of sound channels, log-mel or the speech features of a recurrent network.

Letters: B items, V = 5 mouth frames, S mouth channels a frame of which a member takes X, A = 10
sound steps of 20 ms, D = 144 sound channels, E embedding size, N members.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from dubbing.errors import SyncError
from dubbing.face.mouth.mouth_shape import RIGID
from dubbing.shipped.weights import load_float, save_half
from dubbing.speech.features import fingerprint
from dubbing.sync.network.channels import MOUTH_CHANNELS, SOUND_CHANNELS
from dubbing.sync.network.streams import SIZE, LipStream, PixelStream, SoundStream
from dubbing.sync.network.weight_path import SYNC_WEIGHTS

FORMAT = "dfrf-sync-3"
# Centre and scale: log-mel is 0 in silence and 1 in average speech, and becomes -1.4..1.2.
_LEVELS = {"mel": (0.7, 2.0), "rnn": (0.0, 1.0)}


class MemberInputs(NamedTuple):
    """Inputs of one member: keys of `MOUTH_CHANNELS` and of `SOUND_CHANNELS`."""

    mouth: str
    sound: str


class TwoStream(nn.Module):
    """One pair of streams; both embeddings have length 1."""

    def __init__(self, inputs: MemberInputs) -> None:
        super().__init__()
        self.inputs = inputs
        part = SOUND_CHANNELS[inputs.sound]
        self.mouth = PixelStream() if inputs.mouth == "pixels" else LipStream()
        self.sound = SoundStream(part.stop - part.start)
        # Inverse temperature of the contrastive loss, as a logarithm; starts at 10.
        self.sharpness = nn.Parameter(torch.tensor(2.3))

    def embed_mouth(self, mouth: Float[Tensor, "B V X"]) -> Float[Tensor, "B E"]:
        """Embeddings of the part of `mouth_channels` that this member takes."""
        return F.normalize(self.mouth(mouth), dim=1)

    def embed_sound(self, sound: Float[Tensor, "B A D"]) -> Float[Tensor, "B E"]:
        centre, scale = _LEVELS[self.inputs.sound]
        scaled = (sound[..., SOUND_CHANNELS[self.inputs.sound]] - centre) * scale
        return F.normalize(self.sound(scaled), dim=1)

    def loss(self, mouth: Float[Tensor, "B V X"], sound: Float[Tensor, "B A D"]) -> Tensor:
        """InfoNCE both ways (van den Oord et al. 2018): item b's sound is b's, all others not."""
        logits = self.embed_mouth(mouth) @ self.embed_sound(sound).T * self.sharpness.exp()
        own = torch.arange(len(logits), device=logits.device)
        return (F.cross_entropy(logits, own) + F.cross_entropy(logits.T, own)) / 2


class SyncNetwork(nn.Module):
    """Members with different inputs, and the canonical face that mouths are aligned to.

    Embeddings of the members are concatenated and divided by sqrt(N): the squared distance of two
    of them is the mean of the members' squared distances, 0..4.
    """

    face: Tensor

    def __init__(self, members: Sequence[MemberInputs]) -> None:
        super().__init__()
        self.register_buffer("face", torch.zeros(len(RIGID), 3))
        self.members = nn.ModuleList(TwoStream(inputs) for inputs in members)

    @property
    def size(self) -> int:
        """Values of an embedding, N E."""
        return SIZE * len(self.members)

    def _joined(self, parts: list[Tensor]) -> Tensor:
        return torch.cat(parts, 1) / len(parts) ** 0.5

    def embed_mouth(self, mouth: Float[Tensor, "B V S"]) -> Float[Tensor, "B NE"]:
        """Embeddings of five frames of `mouth_channels`, 40 ms apart."""
        return self._joined(
            [
                member.embed_mouth(mouth[..., MOUTH_CHANNELS[member.inputs.mouth]])
                for member in self.pairs()
            ]
        )

    def embed_sound(self, sound: Float[Tensor, "B A D"]) -> Float[Tensor, "B NE"]:
        """Embeddings of `SoundChannels` of 0.2 s around the same moment."""
        return self._joined([member.embed_sound(sound) for member in self.pairs()])

    def pairs(self) -> list[TwoStream]:
        return [m for m in self.members if isinstance(m, TwoStream)]


def save_network(network: SyncNetwork, path: Path, about: dict[str, Any]) -> None:
    """Write weights in half precision; inputs of the members, and `about`, in the header."""
    header = {
        "format": FORMAT,
        "members": ",".join(f"{m.inputs.mouth}-{m.inputs.sound}" for m in network.pairs()),
        "acoustics": fingerprint("rnn"),
        "about": json.dumps(about),
    }
    save_half(network.state_dict(), path, header)


def load_network(path: Path = SYNC_WEIGHTS) -> SyncNetwork:
    """The network in evaluation mode, float32.

    Raises:
        SyncError: the file is missing, damaged, of another format, or made for other weights of
            the acoustic network.
    """
    remedy = "make one with 'dfrf train-sync', or leave the option out to use ours"
    tensors, header = load_float(path, FORMAT, "sync", remedy, SyncError)
    if header.get("acoustics") != fingerprint("rnn"):
        raise SyncError("made for other weights of the acoustic network", str(path), remedy)
    network = SyncNetwork(
        [MemberInputs(*member.split("-")) for member in header["members"].split(",")]
    )
    network.load_state_dict(tensors)
    return network.eval()
