"""Speech features: what the model hears of a sound, 50 times a second.

Letters: N samples at 16 kHz, T steps of 20 ms, D feature values, F video frames.
A new kind of feature is a class with the members of `SpeechFeatures`; what makes one is entered
in `FEATURES`.
"""

from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import numpy as np

from dubbing.errors import DubbingError
from dubbing.files import digest_file
from dubbing.speech import voice_activity as voice
from dubbing.speech.acoustics.paths import DEFAULT_WEIGHTS
from dubbing.speech.acoustics.paths import weights_file as file_in_folder

RATE = voice.STEP_RATE
# The model hears 16 steps of 20 ms around each video frame.
WINDOW = 16


class SpeechFeatures(Protocol):
    """A kind of speech feature. Value 0 must mean silence: the ends of a sound are filled so."""

    name: str
    dim: int
    rate: int

    def extract(self, samples: np.ndarray) -> np.ndarray:
        """Features (T, dim) float32 of a sound at 16 kHz, (N,)."""

    def extract_blocks(self, blocks: voice.Blocks) -> np.ndarray:
        """The same of a long sound that `blocks()` gives in pieces of any length."""


def mel_filters(bands: int, fft: int, sample_rate: int) -> np.ndarray:
    """Triangular filters of equal area on Slaney's mel scale, (bands, fft / 2 + 1) float32.

    Slaney, Auditory Toolbox (1998): 66.67 Hz a mel up to 1 kHz, then 27 mel a factor of 6.4.
    """
    break_mel, log_step = 15.0, np.log(6.4) / 27
    top = break_mel + np.log(sample_rate / 2 / 1000) / log_step
    mel = np.linspace(0, top, bands + 2)
    hertz = np.where(mel < break_mel, mel * 200 / 3, 1000 * np.exp(log_step * (mel - break_mel)))
    low, mid, high = hertz[:-2, None], hertz[1:-1, None], hertz[2:, None]
    bins = np.arange(fft // 2 + 1) * sample_rate / fft
    slopes = np.minimum((bins - low) / (mid - low), (high - bins) / (high - mid))
    return (np.maximum(slopes, 0) * 2 / (high - low)).astype(np.float32)


class MelFeatures:
    """Log-mel spectrum of 80 bands: 0 in silence, 1 in the average of the loud parts.

    Windows of 32 ms every 20 ms. The average loud spectrum of the sound is subtracted, which
    takes away level, microphone and most of the room; 35 dB below it counts as silence.
    """

    name = "mel"
    dim = 80
    rate = RATE
    _window = 512
    # Orders of magnitude (10 dB) between silence and the average of the loud parts.
    _range = 3.5
    _ceiling = 2.0
    # Steps within this many orders of magnitude of the loudest count as loud.
    _loud = 2.5
    # Nothing lies further than this below the loudest: an empty band of a clean recording is as
    # empty as it would be at another level.
    _depth = 7.0
    # A sound with few loud steps is pulled towards a typical spectrum, as if it had this many
    # more: a line through the long-term average of speech, falling over the mel bands.
    _prior_steps = 25.0
    _prior_fall = 3.5
    # A band that is empty even in loud steps (a telephone, strong compression) stays empty: its
    # average counts as at most this far below that of all bands.
    _emptiest = 2.5

    def __init__(self) -> None:
        self._filters = mel_filters(self.dim, self._window, voice.SAMPLE_RATE)
        self._taper = np.hanning(self._window + 1)[:-1].astype(np.float32)

    def extract(self, samples: np.ndarray) -> np.ndarray:
        return self.extract_blocks(lambda: [samples])

    def extract_blocks(self, blocks: voice.Blocks) -> np.ndarray:
        mels = [self._log_mel(w) for w in voice.step_windows(blocks(), self._window)]
        if not mels:
            return np.zeros((0, self.dim), np.float32)
        return self._normalised(np.concatenate(mels))

    def _log_mel(self, windows: np.ndarray) -> np.ndarray:
        power = np.abs(np.fft.rfft(windows * self._taper, axis=1)) ** 2
        return np.log10(np.maximum(power.astype(np.float32) @ self._filters.T, 1e-14))

    def _normalised(self, mel: np.ndarray) -> np.ndarray:
        energy = mel.max(axis=1)
        loudest = float(np.quantile(energy, 1 - voice.LOUD_SHARE))
        np.maximum(mel, loudest - self._depth, out=mel)
        loud = mel[energy >= loudest - self._loud].astype(np.float64)
        prior = self._prior_fall * np.linspace(0.5, -0.5, self.dim)
        overall = loud.mean()
        total = loud.sum(0) + self._prior_steps * (overall + prior)
        average = total / (len(loud) + self._prior_steps)
        average = np.maximum(average, overall - self._emptiest).astype(np.float32)
        mel -= average - self._range
        mel /= self._range
        return np.clip(mel, 0, self._ceiling, out=mel)


def _mel(weights: Path | None) -> SpeechFeatures:
    return MelFeatures()


def _rnn(weights: Path | None) -> SpeechFeatures:
    # torch is loaded only where it is needed.
    from dubbing.speech.acoustics.recurrent import RnnFeatures

    return RnnFeatures() if weights is None else RnnFeatures(weights)


def _transformer(name: str) -> Callable[[Path | None], SpeechFeatures]:
    def make(weights: Path | None) -> SpeechFeatures:
        from dubbing.speech.transformer_features import TransformerFeatures

        return TransformerFeatures(name, _named(name, weights))

    return make


# Each takes weights of the user's own: none, a file, or a folder.
FEATURES: dict[str, Callable[[Path | None], SpeechFeatures]] = {
    "mel": _mel,
    "rnn": _rnn,
    "hubert": _transformer("hubert"),
    "wav2vec2": _transformer("wav2vec2"),
}
WITHOUT_WEIGHTS = ("mel",)


def features_by_name(name: str, weights: Path | None = None) -> SpeechFeatures:
    """The kind of speech feature called `name`, with weights of the user's own or ours.

    Raises:
        DubbingError: there is none of that name, or its weights cannot be used.
    """
    if name not in FEATURES:
        known = ", ".join(sorted(FEATURES))
        raise DubbingError(f"unknown speech features {name!r}", remedy=f"choose one of: {known}")
    return FEATURES[name](weights)


def weights_file(name: str, weights: Path | None = None) -> Path | None:
    """The file on which the features depend; None for those without weights.

    Raises:
        DubbingError: weights are needed and missing.
    """
    if name in WITHOUT_WEIGHTS:
        return None
    if name == "rnn":
        return weights or DEFAULT_WEIGHTS
    return file_in_folder(_named(name, weights), name)


def fingerprint(name: str, weights: Path | None = None) -> str:
    """Digest of the weights, which a checkpoint remembers; '' for features without."""
    file = weights_file(name, weights)
    return "" if file is None else digest_file(file)


def _named(name: str, weights: Path | None) -> Path:
    if weights is None:
        raise DubbingError(
            f"{name} features need weights of your own",
            remedy="set speech_weights to the folder of a model, or choose speech: rnn",
        )
    return weights


def windows(features: np.ndarray, frames: int, rate: Fraction, first: int = 0) -> np.ndarray:
    """What is heard around each video frame.

    Args:
        features: (T, D), 50 a second.
        frames: how many video frames.
        rate: frames a second.
        first: number of the first frame, to work through a long sound in pieces.

    Returns:
        (frames, 16, D) float32: 16 steps of 20 ms centred on the middle of frame i, at
        (i + 0.5) / rate. Interpolated between steps where the rate asks for it; silence (0)
        before the first and after the last step.
    """
    middle = (np.arange(first, first + frames) + 0.5) / float(rate)
    # The middle of the frame lies between the eighth and the ninth value. At 25 fps it is an edge
    # of the 20 ms grid, so the values are the steps themselves.
    offsets = (np.arange(WINDOW) - (WINDOW - 1) / 2) / RATE
    return voice.at_times(features, middle[:, None] + offsets[None, :])


def features_of_file(
    path: Path, features: SpeechFeatures, *, start: float = 0.0, seconds: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Features (T, D) and voice activity (T,) of a sound file or of the sound of a video.

    The sound is read in blocks, so memory grows by the features only (58 MB an hour for mel).

    Raises:
        MediaError: the file is missing, unreadable or has no sound.
    """
    from dubbing import media

    def blocks() -> Iterable[np.ndarray]:
        return media.iter_audio(path, rate=voice.SAMPLE_RATE, start=start, seconds=seconds)

    return features.extract_blocks(blocks), voice.voice_activity_of_blocks(blocks)
