"""From the network's outputs to the features: principal directions of its output in speech.

Letters: T steps, O = H + S outputs (hidden values, square roots of senone posteriors),
D feature values.
"""

from collections.abc import Sequence

import numpy as np
import torch
from scipy.ndimage import minimum_filter1d

from dubbing.errors import TrainingError
from dubbing.speech import acoustic_input as front
from dubbing.speech.acoustic_network import AcousticNetwork
from dubbing.speech.acoustic_weights import SpeechModel, outputs
from dubbing.speech.phone_classes import SILENCE
from dubbing.workshop.training.speech.corpus import Part

DIM = 64
# Deviation of each principal direction to this power is divided out: 0 leaves the directions as
# strong as they are, 1 makes all alike.
WHITENING = 0.5
# Root mean square of a feature value in speech.
LEVEL = 0.7
# Steps of silence each way before a step counts as the inside of a pause.
_INSIDE = 3


@torch.no_grad()
def project(
    network: AcousticNetwork, parts: Sequence[Part], every: int = 8, dim: int = DIM
) -> SpeechModel:
    """Measures the clean corpus (one utterance of so many) and fixes directions and silence.

    A square root of a posterior weighs as much as a hidden value.

    Raises:
        TrainingError: nobody pauses.
    """
    network.eval()
    filters = front.filters()
    spoken, quiet = [], []
    for part in parts:
        for utterance in part.utterances[::every]:
            sound = torch.from_numpy(utterance.samples.astype(np.float32) / 32768)[None]
            sound = torch.nn.functional.pad(sound, (0, -sound.shape[1] % 320))
            mel = front.log_mel(front.step_windows(sound), filters)
            combined = outputs(network(front.normalised(mel)))[0].double().numpy()
            silent = utterance.classes == SILENCE
            spoken.append(combined[~silent])
            inside = minimum_filter1d(silent.astype(np.uint8), 2 * _INSIDE + 1).astype(bool)
            quiet.append(combined[inside])
    speech, pauses = np.concatenate(spoken), np.concatenate(quiet)
    if not len(pauses):
        raise TrainingError("no pause in the training data", remedy="add more sentences")
    silence = pauses.mean(0)
    values, vectors = np.linalg.eigh(np.cov(speech.T))
    values, vectors = values[::-1][:dim], vectors[:, ::-1][:, :dim]
    projection = vectors.T / np.maximum(values, 1e-9)[:, None] ** (WHITENING / 2)
    level = np.sqrt((((speech - silence) @ projection.T) ** 2).mean())
    projection *= LEVEL / level
    return SpeechModel(
        network,
        torch.from_numpy(projection.astype(np.float32)),
        torch.from_numpy((projection @ silence).astype(np.float32)),
    )
