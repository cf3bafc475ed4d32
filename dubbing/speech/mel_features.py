"""Log-mel speech features: the spectrum on the mel scale, without level and microphone.

Letters: N samples at 16 kHz, T steps of 20 ms, D bands.
"""

import numpy as np

from dubbing.speech import voice_activity as voice


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
    removes level, microphone and most of the room; 35 dB below it counts as silence.
    """

    name = "mel"
    dim = 80
    _window = 512
    # Orders of magnitude (10 dB) between silence and the average of the loud parts.
    _range = 3.5
    _ceiling = 2.0
    # Steps within this many orders of magnitude of the loudest count as loud.
    _loud = 2.5
    # Values are limited to this far below the loudest, so that an empty band of a clean recording
    # does not depend on its level.
    _depth = 7.0
    # The average is biased towards a typical spectrum as by this many more loud steps: a line
    # through the long-term average of speech, falling over the mel bands.
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
