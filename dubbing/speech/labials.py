"""When known words sound, and their p, b and m: their letters are aligned to the sound.

Letters tell too little of how a word sounds, and enough of it here: each may be one of several
phones, or silent, and of vowels any. T steps of 20 ms, S states: the letters, and a pause before,
between and after words. P phone classes.
"""

import unicodedata
from dataclasses import dataclass

import numpy as np

from dubbing.speech import acoustic_inference
from dubbing.speech import voice_activity as voice
from dubbing.speech.acoustic_weights import load_model
from dubbing.speech.phone_classes import CLASS_OF, CLASSES, SILENCE

LABIALS = "pbm"
# The phones that a letter may stand for, in the languages whose letters these are.
VOWELS = "iɪeɛæaɑɔoʊuʌəɜyø"
PHONES = {
    **dict.fromkeys("aeiou", VOWELS),
    **{"y": VOWELS + "jw", "w": "wvuʊ", "b": "bp", "p": "pb", "m": "m", "f": "fv", "v": "vfb"},
    **{"t": "tdθðʃs", "d": "dtð", "n": "nŋmɲ", "s": "szʃʒ", "z": "zstθ", "c": "ksʃt", "k": "kɡ"},
    **{"q": "k", "g": "ɡkʒdx", "h": "hx", "l": "lɲ", "r": "rɹəɜx", "j": "jʒdxh", "x": "kszʃ"},
}
SPELLED = {"п": "p", "б": "b", "м": "m", "π": "p", "μ": "m"}  # in other alphabets
PAUSE, ANY = " ", "*"  # between words; a letter of which nothing is known
EVERY = [k for k in range(len(CLASSES)) if k != SILENCE]
FLOOR = 1e-5  # of probabilities
# Logarithms of probabilities: that a letter is silent, that it is a labial and silent, that a pause
# is no silence, that a letter of which nothing is known is there.
SILENT, SILENT_LABIAL, NOISE, UNKNOWN = -3.0, -9.0, -3.0, -0.7
REACH = 5  # states that a step may go on at most
LEAST = 0.02  # probability of p, b or m that a labial has somewhere, by synthetic speech


@dataclass(frozen=True)
class Labial:
    """A letter, and the middle of its sound in seconds."""

    letter: str
    at: float


@dataclass(frozen=True)
class Word:
    """A word, and the seconds of a sound from and to which it is spoken."""

    text: str
    start: float
    end: float


def labials(blocks: voice.Blocks, words: str) -> list[Labial]:
    """The labials of words that are spoken in a sound, in their order.

    Args:
        blocks: gives the sound in blocks of any length.
    """
    letters = letters_of(words)
    phones = _phones(blocks) if {*letters} & {*LABIALS} else np.zeros((0, len(CLASSES)))
    return in_phones(phones, letters) if len(phones) else []


def words_in(blocks: voice.Blocks, words: str) -> list[Word]:
    """The words that are spoken in a sound, in their order, but for those that are not heard.

    Args:
        blocks: gives the sound in blocks of any length.
    """
    letters, phones = letters_of(words), _phones(blocks)
    if not len(phones) or letters == PAUSE:
        return []
    path = aligned(np.log(phones + FLOOR), letters)
    number = np.cumsum([letter == PAUSE for letter in letters])[path] - 1  # of the word
    spoken = np.array([letter != PAUSE for letter in letters])[path]
    texts = [text for text in words.split() if letters_of(text) != PAUSE]
    found = []
    for k, text in enumerate(texts):
        at = np.flatnonzero(spoken & (number == k))
        if len(at):
            start, stop = at[0] / voice.STEP_RATE, (at[-1] + 1) / voice.STEP_RATE
            found.append(Word(text, float(start), float(stop)))
    return found


def _phones(blocks: voice.Blocks) -> np.ndarray:
    """Probabilities (T, P) of the phones of a sound."""
    spectra = acoustic_inference.spectra_of(blocks())
    if not len(spectra):
        return np.zeros((0, len(CLASSES)))
    network = load_model().network
    return acoustic_inference.run_network(network, spectra, lambda o: o.phones.softmax(-1))


def in_phones(phones: np.ndarray, letters: str) -> list[Labial]:
    """The labials of letters in the probabilities (T, P) of a sound's phones."""
    path = aligned(np.log(phones + FLOOR), letters)
    closed = phones[:, [CLASS_OF[letter] for letter in LABIALS]].sum(1)
    found = []
    for state, letter in enumerate(letters):
        at = np.flatnonzero(path == state)
        if letter in LABIALS and len(at) and closed[at].max() >= LEAST:
            middle = np.average(at, weights=closed[at]) + 0.5
            found.append(Labial(letter, float(middle / voice.STEP_RATE)))
    return found


def letters_of(words: str) -> str:
    """The letters of words in small ones without accents, with pauses before, between and after."""
    found = PAUSE
    for word in unicodedata.normalize("NFD", words.lower()).replace("ph", "f").split():
        for sign in (SPELLED.get(sign, sign) for sign in word if sign.isalnum()):
            letter = sign if sign in PHONES else ANY
            # A double letter is one sound, and so is a row of those of which nothing is known.
            found += "" if letter == found[-1] else letter
        found += "" if found[-1] == PAUSE else PAUSE
    return found


def aligned(likely: np.ndarray, letters: str) -> np.ndarray:
    """The state (T,) of each step on the likeliest way through all letters (Viterbi's).

    Args:
        likely: (T, P) logarithms of the probabilities of phones.
    """
    fits = np.stack([_fit(likely, letter) for letter in letters], 1)
    silent = {PAUSE: 0.0, **dict.fromkeys(LABIALS, SILENT_LABIAL)}
    # Sums over the states before each, so that a difference is what it costs to leave some out.
    left_out = np.cumsum([0.0, *(silent.get(letter, SILENT) for letter in letters)])
    state = np.arange(len(letters))
    best, came = fits[0] + left_out[:-1], np.zeros(fits.shape, int)
    for t in range(1, len(fits)):
        ways = np.full((REACH + 1, len(letters)), -np.inf)
        for far in range(min(REACH + 1, len(letters))):
            own = state[far:]
            skipped = left_out[own] - left_out[own - far + 1] if far else 0.0
            ways[far, far:] = best[: len(own)] + skipped
        came[t] = ways.argmax(0)
        best = ways[came[t], state] + fits[t]
    path = [int((best + left_out[-1] - left_out[1:]).argmax())]
    for t in range(len(fits) - 1, 0, -1):
        path.append(path[-1] - came[t, path[-1]])
    return np.array(path[::-1])


def _fit(likely: np.ndarray, letter: str) -> np.ndarray:
    """How well each step (T,) fits a letter, as a logarithm."""
    if letter == PAUSE:
        return np.logaddexp(likely[:, SILENCE], NOISE)
    known = [CLASS_OF[phone] for phone in PHONES.get(letter, "")]
    fit: np.ndarray = np.logaddexp.reduce(likely[:, sorted({*known}) or EVERY], axis=1)
    return fit if known else fit + UNKNOWN
