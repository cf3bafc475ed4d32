"""How late the voices of a mix are heard in a finished video: a fault of its mux shows here."""

from pathlib import Path

import numpy as np

from dubbing import media
from dubbing.speech.voice_activity import SAMPLE_RATE

LISTENED_SECONDS = 30.0
MOST_SECONDS = 1.0  # of a lag, to either side
# Height of the correlation's peak in standard deviations: 9 with other speech, 71 where music is
# ten times as strong as the voices (20 dB).
CLEAR_PEAK = 20.0


def voices_lag(video: Path, voices: Path, start: float = 0.0) -> float | None:
    """Seconds by which voices are late in a video's sound; None where they are not heard in it.

    A generalised cross-correlation with phase transform (Knapp and Carter 1976): a bed under the
    voices, and their gain, matter little.

    Args:
        voices: a file that starts together with the video.
        start: second from which on `LISTENED_SECONDS` are compared.

    Raises:
        MediaError: one of them has no sound, or it cannot be decoded.
    """
    heard, voice = (
        media.read_audio(path, rate=SAMPLE_RATE, start=start, seconds=LISTENED_SECONDS)
        for path in (video, voices)
    )
    reach = round(MOST_SECONDS * SAMPLE_RATE)
    length = max(len(heard), len(voice)) + reach
    cross = np.fft.rfft(heard, length) * np.conj(np.fft.rfft(voice, length))
    size = np.abs(cross)
    correlation = np.fft.irfft(cross / np.maximum(size, 1e-9 * size.max() + 1e-30), length)
    near = np.concatenate([correlation[-reach:], correlation[: reach + 1]])
    best = int(np.argmax(near))
    if not near[best] > CLEAR_PEAK * near.std():  # silence has neither
        return None
    return (best - reach) / SAMPLE_RATE
