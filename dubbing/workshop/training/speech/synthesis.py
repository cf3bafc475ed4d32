"""Speech synthesisers as teachers: sound with phones that are known to the sample.

flite's voices are cut from recordings of people, espeak-ng speaks many languages, festival (where
it is installed) adds voices whose phones are not read out.
"""

import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.engine.environment import of_children
from dubbing.errors import TrainingError
from dubbing.speech.voice_activity import SAMPLE_RATE
from dubbing.workshop.synthetic.visemes import Phone
from dubbing.workshop.synthetic.voice import synthesise
from dubbing.workshop.training.speech.phones import ARPABET

FLITE, ESPEAK, FESTIVAL = "flite", "espeak", "festival"
# Variants of espeak-ng's voice: other formants, pitches and roughness.
VARIANTS = ("", "+m1", "+m2", "+m3", "+m4", "+m5", "+m6", "+m7", "+f1", "+f2", "+f3", "+f4", "+f5")


@dataclass(frozen=True)
class Voice:
    """Who speaks: the synthesiser, its voice and the language of the text."""

    engine: str
    name: str
    language: str

    @property
    def label(self) -> str:
        return f"{self.engine} {self.name}"


@dataclass(frozen=True)
class Spoken:
    """Samples (N,) float32 at 16 kHz; the phones that cover them, or None where untold."""

    samples: np.ndarray
    phones: list[Phone] | None


FLITE_VOICES = tuple(Voice(FLITE, name, "en-us") for name in ("slt", "rms", "awb", "kal16"))
FESTIVAL_VOICES = (
    Voice(FESTIVAL, "kal_diphone", "en-us"),
    Voice(FESTIVAL, "ked_diphone", "en-us"),
    Voice(FESTIVAL, "lp_diphone", "it"),
    Voice(FESTIVAL, "pc_diphone", "it"),
)


def espeak_voice(language: str) -> Voice:
    return Voice(ESPEAK, language, language)


def available(voice: Voice) -> bool:
    """Whether this machine can speak with it; espeak-ng comes with the package."""
    if voice.engine == FLITE:
        return shutil.which("flite") is not None
    if voice.engine == FESTIVAL:
        return shutil.which("text2wave") is not None and any(
            Path("/usr/share/festival/voices").glob(f"*/{voice.name}")
        )
    return True


def speak(voice: Voice, text: str, rng: np.random.Generator) -> Spoken:
    """Speaks `text` at a random rate and pitch.

    Raises:
        TrainingError: the synthesiser failed.
    """
    if voice.engine == ESPEAK:
        return _espeak(voice, text, rng)
    with tempfile.TemporaryDirectory(prefix="speech-") as folder:
        wav = Path(folder) / "speech.wav"
        if voice.engine == FLITE:
            return _flite(voice, text, wav, rng)
        return _festival(voice, text, wav)


def _espeak(voice: Voice, text: str, rng: np.random.Generator) -> Spoken:
    variant = VARIANTS[rng.integers(len(VARIANTS))]
    samples, rate, phones = synthesise(
        text,
        voice.name + variant,
        words_per_minute=int(rng.integers(130, 210)),
        pitch=int(rng.integers(20, 80)),
    )
    return Spoken(at_model_rate(samples, rate), phones)


def _flite(voice: Voice, text: str, wav: Path, rng: np.random.Generator) -> Spoken:
    stretch = f"duration_stretch={rng.uniform(0.8, 1.25):.2f}"
    call = ["flite", "-voice", voice.name, "--setf", stretch, "-psdur", "-t", text, str(wav)]
    lines = _run(call).split()
    phones, start = [], 0.0
    for entry in lines:
        name, _, end = entry.rpartition(":")
        phones.append(Phone(ARPABET.get(name, name), start, float(end)))
        # A sentence of several clauses counts on; should it ever start again, so do we.
        start = float(end)
    return Spoken(_read(wav), phones)


def _festival(voice: Voice, text: str, wav: Path) -> Spoken:
    script = wav.with_suffix(".txt")
    # Its Italian and English voices read Latin-1.
    script.write_bytes(text.encode("latin-1", errors="ignore"))
    _run(["text2wave", "-eval", f"(voice_{voice.name})", "-o", str(wav), str(script)])
    return Spoken(_read(wav), None)


def _run(call: list[str]) -> str:
    try:
        done = subprocess.run(call, capture_output=True, check=True, timeout=120, env=of_children())
    except (OSError, subprocess.SubprocessError) as error:
        raise TrainingError(
            f"{call[0]} failed: {error}", remedy=f"install {call[0]}, or leave its voices out"
        ) from error
    return done.stdout.decode(errors="replace")


def _read(wav: Path) -> np.ndarray:
    import soundfile

    samples, rate = soundfile.read(wav, dtype="float32")
    return at_model_rate(samples, rate)


def at_model_rate(samples: np.ndarray, rate: int) -> np.ndarray:
    """Samples (N,) resampled to 16 kHz, float32."""
    from scipy.signal import resample_poly

    if rate == SAMPLE_RATE:
        return samples.astype(np.float32)
    common = int(np.gcd(rate, SAMPLE_RATE))
    return resample_poly(samples, SAMPLE_RATE // common, rate // common).astype(np.float32)
