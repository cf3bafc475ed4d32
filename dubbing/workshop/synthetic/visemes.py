"""Mouth shapes of phones: a table of visemes and the curves through them.

Phones are IPA symbols as espeak-ng writes them. Targets lead the sound and are smoothed, as
articulators move before the sound they make; closures (p, b, m) and the lip to tooth contact of
f and v are then forced, because without them a viewer sees the wrong consonant.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

LEAD = 0.030  # seconds by which the mouth runs ahead of the sound
SMOOTHING = 0.034  # seconds, standard deviation of the Gaussian over the targets
FINE_RATE = 500  # samples a second of the curves before they are read at the video rate
CHANNELS = ("jaw", "part", "wide", "protrude", "press", "tuck", "tongue")


@dataclass(frozen=True)
class Phone:
    """One phone: its IPA symbol ("" is silence) and when it sounds, in seconds."""

    symbol: str
    start: float
    end: float


#        jaw  part  wide  protrude press tuck tongue   (0..1; wide -1..1)
REST = (0.00, 0.00, 0.00, 0.00, 0.00, 0.0, 0.0)
CLOSED = (0.02, 0.00, 0.00, 0.05, 0.90, 0.0, 0.0)
LIP_TOOTH = (0.10, 0.10, 0.10, 0.00, 0.00, 1.0, 0.0)
OPEN_A = (0.95, 0.35, 0.10, 0.00, 0.00, 0.0, 0.0)
MID_E = (0.50, 0.45, 0.45, 0.00, 0.00, 0.0, 0.1)
SPREAD_I = (0.22, 0.50, 0.80, 0.00, 0.00, 0.0, 0.3)
ROUND_O = (0.55, 0.25, -0.65, 0.60, 0.00, 0.0, 0.0)
ROUND_U = (0.30, 0.24, -0.90, 1.00, 0.00, 0.0, 0.0)
NEUTRAL = (0.38, 0.30, 0.00, 0.05, 0.00, 0.0, 0.1)
HISS = (0.10, 0.45, 0.35, 0.10, 0.00, 0.0, 0.4)
HUSH = (0.14, 0.50, -0.55, 0.85, 0.00, 0.0, 0.3)
TIP = (0.22, 0.35, 0.10, 0.00, 0.00, 0.0, 1.0)
TEETH = (0.20, 0.35, 0.15, 0.00, 0.00, 0.0, 0.9)
BACK = (0.30, 0.30, 0.00, 0.00, 0.00, 0.0, 0.2)
APPROX_R = (0.24, 0.30, -0.35, 0.45, 0.00, 0.0, 0.5)

VISEMES: dict[str, tuple[float, ...]] = {
    **dict.fromkeys("pbm", CLOSED),
    **dict.fromkeys("fvɱʋ", LIP_TOOTH),
    **dict.fromkeys("aɑæɐʌɶ", OPEN_A),
    **dict.fromkeys("eɛœøɘ", MID_E),
    **dict.fromkeys("iɪjɨ", SPREAD_I),
    **dict.fromkeys("oɔɒ", ROUND_O),
    **dict.fromkeys("uʊwyʏɯɥ", ROUND_U),
    **dict.fromkeys("əɜɚɝɤ", NEUTRAL),
    **dict.fromkeys("szcɕʑ", HISS),
    **dict.fromkeys("ʃʒʂʐ", HUSH),
    **dict.fromkeys("tdnlɾɫɲʎ", TIP),
    **dict.fromkeys("θð", TEETH),
    **dict.fromkeys("kgŋɡxɣhçʔʁqχħʕ", BACK),
    **dict.fromkeys("rɹɻʀ", APPROX_R),
}
ROUNDED_FRONT = "øœyʏ"


def targets(symbol: str) -> list[tuple[float, ...]]:
    """The mouth targets within one phone: one each for the parts of a diphthong or an affricate."""
    shapes = []
    for letter in symbol:
        if letter in VISEMES:
            target = list(VISEMES[letter])
            if letter in ROUNDED_FRONT:
                target[2], target[3] = -0.7, 0.8
            shapes.append(tuple(target))
    return shapes or [REST]


def mouth_curves(phones: list[Phone], frames: int, rate: Fraction) -> np.ndarray:
    """Mouth parameters (frames, 7) in the order of CHANNELS, at the middle of each frame.

    Frame i shows the mouth at (i + 0.5) / rate seconds of the sound.
    """
    seconds = float(frames / rate) + 1.0
    fine = np.zeros((round(seconds * FINE_RATE), len(CHANNELS)))
    closure = np.zeros(len(fine))
    contact = np.zeros(len(fine))
    for phone in phones:
        parts = targets(phone.symbol)
        edges = np.linspace(phone.start, phone.end, len(parts) + 1) - LEAD
        for part, low, high in zip(parts, edges[:-1], edges[1:], strict=True):
            begin, end = max(0, round(low * FINE_RATE)), max(0, round(high * FINE_RATE))
            fine[begin:end] = part
            if part == CLOSED:
                closure[begin : max(end, begin + 1)] = 1.0
            if part == LIP_TOOTH:
                contact[begin : max(end, begin + 1)] = 1.0
    smooth = _gaussian(fine, SMOOTHING)
    shut = np.clip(_gaussian(_hold(closure)[:, None], 0.014)[:, 0] * 1.25, 0.0, 1.0)
    bite = np.clip(_gaussian(_hold(contact)[:, None], 0.018)[:, 0] * 1.2, 0.0, 1.0)
    smooth += shut[:, None] * (np.array(CLOSED) - smooth)
    smooth += bite[:, None] * (np.array(LIP_TOOTH) - smooth)
    times = (np.arange(frames) + 0.5) / float(rate)
    return np.stack(
        [np.interp(times, np.arange(len(fine)) / FINE_RATE, c) for c in smooth.T], axis=1
    )


def _hold(track: np.ndarray) -> np.ndarray:
    """Widens each event so that at least one video frame of 1/25 s shows it."""
    from scipy.ndimage import maximum_filter1d

    return maximum_filter1d(track, round(0.05 * FINE_RATE) | 1)


def _gaussian(curves: np.ndarray, sigma: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(curves, sigma * FINE_RATE, axis=0, mode="nearest")
