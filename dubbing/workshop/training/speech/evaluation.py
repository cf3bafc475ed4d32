"""Tables of docs/development/speech.md: speech features predict lips, and how robust they are.

    python -m dubbing.workshop.training.speech.evaluation CLIP... [--test CLIP...]

Clips show one talking person each. `dubbing.workshop.training.speech.probe` leaves each one out in
turn; --test clips are predicted from all of them. Rows that need pocketsphinx or flite are left out
where these are not installed.
"""

import argparse
import importlib.util
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from dubbing import media
from dubbing.speech import acoustic_inference
from dubbing.speech import voice_activity as voice
from dubbing.speech.acoustic_weights import load_model
from dubbing.speech.features import SpeechFeatures, features_of_file
from dubbing.speech.mel_features import MelFeatures
from dubbing.workshop.training.speech import corpus, probe, synthesis
from dubbing.workshop.training.speech.phones import classes_at_steps
from dubbing.workshop.training.speech.teacher import senone_posteriors
from dubbing.workshop.training.speech.texts import sentence

NOISE_DB = 10.0
RATES = (8000, 16_000, 44_100, 48_000)
SENTENCES = 12
CEPSTRA = 13

Extract = Callable[[np.ndarray], np.ndarray]
TIMED_SECONDS = 120.0  # of sound, for the real-time factor


def cepstra(samples: np.ndarray) -> np.ndarray:
    """Cepstra of the log-mel features and their slope over five steps, (T, 26)."""
    mel = MelFeatures().extract(samples)
    waves = np.cos(np.pi * np.outer(np.arange(mel.shape[1]) + 0.5, np.arange(CEPSTRA)) / 80)
    values = (mel @ (waves / 40)).astype(np.float32)
    slope = np.gradient(values, axis=0) if len(values) > 1 else np.zeros_like(values)
    return np.concatenate([values, slope], 1)


def senones(samples: np.ndarray) -> np.ndarray:
    """Square roots of the teacher's posteriors, (T, 126)."""
    return np.sqrt(senone_posteriors(samples))


def compared(rnn: SpeechFeatures) -> dict[str, Extract]:
    """Features to compare, by name; the first is the baseline of the others."""
    kinds: dict[str, Extract] = {"log-mel": MelFeatures().extract, "MFCC + delta": cepstra}
    if importlib.util.find_spec("pocketsphinx") is not None:
        kinds["pocketsphinx senones"] = senones
        kinds["senones + rnn"] = lambda s: np.concatenate([senones(s), rnn.extract(s)], 1)
    kinds["rnn"] = rnn.extract
    return kinds


def pink_noise(count: int, rng: np.random.Generator) -> np.ndarray:
    """Noise whose power falls by 3 dB an octave, of power 1, (count,)."""
    spectrum = np.fft.rfft(rng.standard_normal(count))
    spectrum /= np.sqrt(np.maximum(np.arange(len(spectrum)), 1))
    noise = np.fft.irfft(spectrum, count)
    return (noise / np.sqrt((noise**2).mean())).astype(np.float32)


def noisy(samples: np.ndarray) -> np.ndarray:
    """With pink noise NOISE_DB below the sound's mean power."""
    noise = pink_noise(len(samples), np.random.default_rng(0))
    return samples + noise * np.sqrt((samples**2).mean()) * 10 ** (-NOISE_DB / 20)


def probe_table(
    people: list[probe.Speaker], tests: list[probe.Speaker], rnn: SpeechFeatures
) -> str:
    """Markdown: a row a feature. Ahead: people on whom it beats the first row."""
    heads = ["feature", "D", "opening", "width", "gain", f"ahead (of {len(people)})"]
    heads += ["pink noise 10 dB", *(["test clips"] if tests else [])]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    sounds = [media.read_audio(p.path) for p in people]
    plain: np.ndarray | None = None
    for name, extract in compared(rnn).items():
        features = [extract(s) for s in sounds]
        fitted = probe.fit(people, features)
        clean = fitted.left_out
        plain = clean if plain is None else plain
        degraded = probe.fit(people, [extract(noisy(s)) for s in sounds]).left_out
        ahead = (clean > plain).sum(0)
        cells = [name, str(features[0].shape[1]), *(f"{v:.3f}" for v in clean.mean(0))]
        cells.append(pair((clean - plain).mean(0), "+.3f") if name != "log-mel" else "")
        cells.append(f"{ahead[0]} / {ahead[1]}" if name != "log-mel" else "")
        cells.append(pair(degraded.mean(0)))
        if tests:
            series = [extract(media.read_audio(t.path)) for t in tests]
            tested = probe.unseen(fitted, tests, series)
            each = ", ".join(
                f"{t.name} {pair(r, '.2f')}" for t, r in zip(tests, tested, strict=True)
            )
            cells.append(f"{pair(tested.mean(0))} ({each})")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def pair(values: np.ndarray, form: str = ".3f") -> str:
    return f"{values[0]:{form}} / {values[1]:{form}}"


@torch.no_grad()
def phone_errors(weights: Path | None = None) -> str:
    """Markdown: share of steps whose phone class is wrong, on sentences never trained on."""
    model = load_model() if weights is None else load_model(weights)
    voices = [
        ("trained on", synthesis.FLITE_VOICES[0]),
        ("trained on", synthesis.FLITE_VOICES[1]),
        (
            "voice left out",
            next(v for v in synthesis.FLITE_VOICES if v.name == corpus.LEFT_OUT_VOICE),
        ),
        *(("trained on", synthesis.espeak_voice(name)) for name in ("en-us", "de")),
        ("language left out", synthesis.espeak_voice(corpus.LEFT_OUT_LANGUAGE)),
    ]
    lines = ["| voice | | frame phone error |", "|---|---|---|"]
    for role, speaker in voices:
        if not synthesis.available(speaker):
            continue
        rng = np.random.default_rng(99)
        wrong = total = 0
        for _ in range(SENTENCES):
            spoken = synthesis.speak(speaker, sentence(speaker.language, rng, 10), rng)
            spectra = acoustic_inference.spectra_of([spoken.samples])
            predicted = acoustic_inference.run_network(
                model.network, spectra, lambda outputs: outputs.phones
            ).argmax(1)
            truth = classes_at_steps(spoken.phones or [], len(predicted))
            wrong += int((predicted != truth)[truth >= 0].sum())
            total += int((truth >= 0).sum())
        lines.append(f"| {speaker.label} | {role} | {wrong / total:.3f} |")
    return "\n".join(lines)


def cosine(a: np.ndarray, b: np.ndarray) -> float:
    """Of two features (T, D) of the same sound, over all steps; a step more or less is cut off."""
    count = min(len(a), len(b))
    x, y = a[:count].ravel().astype(np.float64), b[:count].ravel().astype(np.float64)
    return float(x @ y / np.sqrt((x @ x) * (y @ y)))


def invariance(path: Path, rnn: SpeechFeatures) -> str:
    """Markdown: cosine of the features of one recording at other rates and channel counts."""
    import soundfile
    from scipy.signal import resample_poly

    samples = media.read_audio(path, rate=48_000)
    plain = rnn.extract(media.read_audio(path))
    lines = ["| rate, Hz | mono | stereo |", "|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        for rate in RATES:
            common = int(np.gcd(rate, 48_000))
            sound = resample_poly(samples, rate // common, 48_000 // common)
            cells = []
            for channels in (1, 2):
                file = Path(folder) / f"{rate}-{channels}.wav"
                soundfile.write(file, np.repeat(sound[:, None], channels, 1), rate)
                other, _ = features_of_file(file, rnn)
                cells.append(f"{cosine(plain, other):.4f}")
            lines.append(f"| {rate} | {' | '.join(cells)} |")
    return "\n".join(lines)


def pause(samples: np.ndarray, rnn: SpeechFeatures) -> str:
    """Markdown: features in 2 s of pause between two stretches of speech, (N,) at 16 kHz.

    The pause is digital silence, or room noise so far below the speech.
    """
    rate = voice.SAMPLE_RATE
    level = np.sqrt((samples**2).mean())
    before, after = samples[: 4 * rate], samples[4 * rate : 8 * rate]
    lines = ["| pause | largest value, speech | from 0.4 s into it | first step of 0 |"]
    lines.append("|---|---|---|---|")
    for name, decibel in (("silent", None), ("noise 60 dB below", -60), ("40 dB below", -40)):
        gain = 0.0 if decibel is None else level * 10 ** (decibel / 20)
        gap = pink_noise(2 * rate, np.random.default_rng(0)) * np.float32(gain)
        largest = np.abs(rnn.extract(np.concatenate([before, gap, after]))).max(1)
        begin = voice.steps(len(before))
        inside = largest[begin : begin + 2 * voice.STEP_RATE]
        zero = np.flatnonzero(inside == 0)
        when = f"{zero[0] / voice.STEP_RATE:.2f} s" if len(zero) else "never"
        deep = inside[round(0.4 * voice.STEP_RATE) : -round(0.4 * voice.STEP_RATE)].max()
        lines.append(f"| {name} | {largest[:begin].max():.2f} | {deep:.2f} | {when} |")
    return "\n".join(lines)


def real_time_factor(samples: np.ndarray, rnn: SpeechFeatures) -> float:
    """Seconds of computing, on one thread, for a second of sound."""
    count = round(TIMED_SECONDS * voice.SAMPLE_RATE)
    long = np.tile(samples, -(-count // len(samples)))[:count]
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    begin = time.process_time()
    rnn.extract(long)
    spent = time.process_time() - begin
    torch.set_num_threads(threads)
    return spent / TIMED_SECONDS


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("clips", nargs="+", type=Path)
    parser.add_argument("--test", nargs="*", type=Path, default=[], help="clips never trained on")
    parser.add_argument("--cache", type=Path, help="folder to keep the measured clips in")
    parser.add_argument("--weights", type=Path, help="other weights than the shipped ones")
    chosen = parser.parse_args(arguments)
    from dubbing.speech.rnn_features import RnnFeatures

    rnn = RnnFeatures() if chosen.weights is None else RnnFeatures(chosen.weights)
    everyone = probe.speakers([*chosen.clips, *chosen.test], chosen.cache)
    people, tests = everyone[: len(chosen.clips)], everyone[len(chosen.clips) :]
    print(probe_table(people, tests, rnn), end="\n\n")
    print(phone_errors(chosen.weights), end="\n\n")
    print(invariance(chosen.clips[0], rnn), end="\n\n")
    sound = media.read_audio(chosen.clips[0])
    print(pause(sound, rnn), end="\n\n")
    print(f"Real-time factor on one core: {real_time_factor(sound, rnn):.4f}")


if __name__ == "__main__":
    main()
