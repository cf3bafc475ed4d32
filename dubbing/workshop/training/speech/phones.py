"""Phone classes of synthesised speech; see `dubbing.speech.phone_classes`.

Diphthongs and affricates are their parts, one after the other.
"""

from collections.abc import Sequence

import numpy as np

from dubbing.speech.phone_classes import CLASS_OF, SILENCE
from dubbing.speech.voice_activity import STEP_RATE
from dubbing.workshop.synthetic.visemes import Phone

UNKNOWN = -1

# Phones of flite and festival's English voices, as espeak-ng would write them.
ARPABET = {
    **{"aa": "ɑ", "ae": "æ", "ah": "ʌ", "ao": "ɔ", "aw": "aʊ", "ax": "ə", "axr": "ɚ", "ay": "aɪ"},
    **{"b": "b", "ch": "tʃ", "d": "d", "dh": "ð", "eh": "ɛ", "er": "ɚ", "ey": "eɪ", "f": "f"},
    **{"g": "ɡ", "hh": "h", "ih": "ɪ", "iy": "i", "jh": "dʒ", "k": "k", "l": "l", "m": "m"},
    **{"n": "n", "ng": "ŋ", "ow": "oʊ", "oy": "ɔɪ", "p": "p", "r": "ɹ", "s": "s", "sh": "ʃ"},
    **{"t": "t", "th": "θ", "uh": "ʊ", "uw": "u", "v": "v", "w": "w", "y": "j", "z": "z"},
    **{"zh": "ʒ", "pau": "", "ssil": "", "dx": "ɾ", "en": "n", "em": "m", "el": "l", "nx": "n"},
}


def letters(symbol: str) -> list[str]:
    """The letters of an IPA symbol that belong to a class; marks of length and tone fall away."""
    return [c for c in symbol if c in CLASS_OF]


def classes_at_steps(phones: Sequence[Phone], count: int) -> np.ndarray:
    """Class of the middle of each 20 ms step, (count,) int64; UNKNOWN outside all phones.

    A symbol of several letters is divided evenly among them.
    """
    labels = np.full(count, UNKNOWN, np.int64)
    for phone in phones:
        known = letters(phone.symbol)
        parts = [CLASS_OF[c] for c in known] or [UNKNOWN if phone.symbol else SILENCE]
        edges = np.linspace(phone.start, phone.end, len(parts) + 1) * STEP_RATE - 0.5
        places = np.clip(np.ceil(edges), 0, count).astype(int)
        for part, low, high in zip(parts, places[:-1], places[1:], strict=True):
            labels[low:high] = part
    return labels
