"""Predicts lips from audio, 50 times a second.

Letters: T steps of 20 ms, P = 40 numbers of each.
"""

from functools import lru_cache

import numpy as np
import torch

from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.sound_to_lips.encoder import STEP, encode
from dubbing.sound_to_lips.lip_network import LipNetwork, load
from dubbing.speech import voice_activity as voice

LEVEL_DB = -20.0  # of the loud parts of the encoder's input


@lru_cache(maxsize=1)
def _network() -> LipNetwork:
    return load()


def gain_of(energy: np.ndarray) -> float:
    """Gain of audio for the encoder, from the energy (T,) of its steps in dB."""
    level = voice.loudness_db(energy)
    return 10 ** ((LEVEL_DB - level) / 20) if level > voice.SILENCE_DB else 0.0


@torch.no_grad()
def predict(blocks: voice.Blocks) -> np.ndarray:
    """Speaker-independent lips and sound features of audio.

    Args:
        blocks: gives the audio in blocks of any length; called twice.

    Returns:
        (T, P) for `dfrf.field.speaker_adaptation`: seven measures as of
        `dubbing.face.mouth.lip_measures`, of about mean 0 over speech, a score that rises where
        the lips touch, and 32 features of the sound.
    """
    network = _network()
    energy = voice.energy_db(blocks())
    if not len(energy):
        return np.zeros((0, NUMBERS), np.float32)
    answers = network.filter(encode(network.encoder, blocks(), gain_of(energy))).numpy()
    middle = (np.arange(len(energy)) + 0.5) * voice.HOP
    steps = (np.arange(len(answers)) + 0.5) * STEP
    table = np.stack([np.interp(middle, steps, answers[:, k]) for k in range(NUMBERS)], 1)
    return table.astype(np.float32)
