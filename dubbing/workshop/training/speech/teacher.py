"""The teacher: senone posteriors of pocketsphinx's English model, which comes in its package.

Letters: N samples at 16 kHz, T steps of 20 ms, S = 126 context-independent states (senones).
"""

import tempfile
from pathlib import Path

import numpy as np

from dubbing import packages
from dubbing.errors import TrainingError
from dubbing.speech.acoustic_network import SENONES
from dubbing.speech.voice_activity import HOP, SAMPLE_RATE, steps

ALL_SENONES = 5126
# A score of the dump is a negative logarithm to the base 1.0001, divided by 1024.
NATS_PER_SCORE = -np.log(1.0001) * 1024
_FRAME_HOP, _FRAME_WIDTH = 160, 410
# A dump holds 1 MB a second: longer sounds are heard in pieces, each with half a second around.
PIECE_SECONDS, AROUND_SECONDS = 30, 0.5


def senone_posteriors(samples: np.ndarray) -> np.ndarray:
    """Posteriors of the context-independent senones at every step, (T, S) float32.

    Args:
        samples: (N,) float32 at 16 kHz, -1..1.

    Raises:
        TrainingError: pocketsphinx is not installed.
    """
    total = steps(len(samples))
    piece, around = PIECE_SECONDS * SAMPLE_RATE, int(AROUND_SECONDS * SAMPLE_RATE)
    result = np.zeros((total, SENONES), np.float32)
    for begin in range(0, len(samples), piece):
        low, high = max(0, begin - around), min(len(samples), begin + piece + around)
        frames = _posteriors(samples[low:high])
        first, last = begin // HOP, min(total, (begin + piece) // HOP)
        # Where the middle of each step lies between the middles of the teacher's frames.
        middles = (np.arange(first, last) + 0.5) * HOP - low
        place = np.clip((middles - _FRAME_WIDTH / 2) / _FRAME_HOP, 0, len(frames) - 1)
        before = np.minimum(place.astype(int), max(0, len(frames) - 2))
        share = (place - before)[:, None]
        after = np.minimum(before + 1, len(frames) - 1)
        result[first:last] = frames[before] * (1 - share) + frames[after] * share
    return result


def _posteriors(samples: np.ndarray) -> np.ndarray:
    """Posteriors of the teacher's own frames, 100 a second, (frames, S)."""
    try:
        from pocketsphinx import Decoder, get_model_path
    except ImportError as error:
        raise TrainingError(
            "the teacher is missing", "pocketsphinx", packages.command(["pocketsphinx"])
        ) from error
    loudest = max(float(np.abs(samples).max()), 1e-4)
    pcm = np.round(samples * (0.5 * 32767 / loudest)).astype("<i2")
    with tempfile.TemporaryDirectory(prefix="senones-") as folder:
        # Tight beams: the search for phones is not used, only the scores it is given.
        decoder = Decoder(
            **{"allphone": get_model_path("en-us/en-us-phone.lm.bin"), "lm": None, "dict": None},
            **{"compallsen": True, "senlogdir": folder, "loglevel": "FATAL"},
            **{"beam": 1e-5, "pbeam": 1e-5, "cmn": "batch"},
        )
        decoder.start_utt()
        decoder.process_raw(pcm.tobytes(), no_search=False, full_utt=True)
        decoder.end_utt()
        scores = _read_dump(next(Path(folder).iterdir()).read_bytes())
    nats = NATS_PER_SCORE * scores.astype(np.float32)
    nats -= nats.max(1, keepdims=True)
    likelihood = np.exp(nats)
    return likelihood / likelihood.sum(1, keepdims=True)


def _read_dump(dump: bytes) -> np.ndarray:
    """Scores of the context-independent senones in a senone log, (frames, S) int16."""
    header = dump.index(b"endhdr\n") + len(b"endhdr\n") + 4
    values = np.frombuffer(dump[header:], "<i2")
    # Each frame begins with the number of its scores.
    frames = values[: len(values) // (ALL_SENONES + 1) * (ALL_SENONES + 1)]
    return frames.reshape(-1, ALL_SENONES + 1)[:, 1 : SENONES + 1]
