"""Voice activity: found, level-robust, the same in blocks."""

from collections.abc import Iterator
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import torch

from dubbing.speech import voice_activity as voice
from dubbing.speech import voice_detector
from dubbing.speech.weight_paths import VOICE_DETECTOR
from dubbing.workshop.synthetic.voice import synthesise

RNG = np.random.default_rng(0)


def vowels(seconds: float) -> np.ndarray:
    """A buzz of 120 Hz through four formants and breath, in syllables: enough for a detector."""
    t = np.arange(round(seconds * voice.SAMPLE_RATE)) / voice.SAMPLE_RATE
    phase = 2 * np.pi * 120 * t + 2 * np.sin(2 * np.pi * 3 * t)
    sound = np.zeros_like(t)
    for h in range(1, 60):
        weight = sum(
            g / (1 + ((120 * h - f) / 90) ** 2)
            for f, g in ((600, 1), (1200, 0.6), (2500, 0.3), (4500, 0.1))
        )
        sound += weight * np.sin(h * phase)
    sound = sound / np.abs(sound).max() + 0.03 * np.random.default_rng(1).normal(size=len(t))
    sound *= 0.6 + 0.4 * np.sin(2 * np.pi * 4 * t)
    return (0.2 * sound / np.abs(sound).max()).astype(np.float32)


def words(seconds: float) -> np.ndarray:
    """The beginning of what a synthesiser says."""
    samples, rate, _ = synthesise("We walked along the river for an hour or more.", "en-us")
    times = np.arange(round(seconds * voice.SAMPLE_RATE)) / voice.SAMPLE_RATE
    return np.interp(times, np.arange(len(samples)) / rate, samples).astype(np.float32)


def music(seconds: float) -> np.ndarray:
    """A melody of plucked tones, and a drum, rms 1."""
    notes = np.random.default_rng(3).choice([0, 2, 4, 5, 7, 9, 12], round(4 * seconds))
    beat = np.arange(voice.SAMPLE_RATE // 4) / voice.SAMPLE_RATE
    fading = np.exp(-6 * beat)
    tones = [
        sum(np.sin(2 * np.pi * 220 * 2 ** (note / 12) * h * beat) / h for h in range(1, 9))
        for note in notes
    ]
    drum = 2 * np.sin(2 * np.pi * 60 * beat) * fading**2
    sound = np.concatenate([tone * fading + drum for tone in tones])
    return (sound / np.sqrt(np.mean(sound**2))).astype(np.float32)


def silence(seconds: float) -> np.ndarray:
    noise = RNG.normal(size=round(seconds * voice.SAMPLE_RATE))
    return (1e-5 * noise).astype(np.float32)


def pieces(sound: np.ndarray, sizes: tuple[int, ...]) -> Iterator[np.ndarray]:
    place = k = 0
    while place < len(sound):
        size = sizes[k % len(sizes)]
        yield sound[place : place + size]
        place, k = place + size, k + 1


def test_speech_is_found_where_it_is() -> None:
    activity = voice.voice_activity(np.concatenate([silence(1), words(2), silence(1)]))
    assert activity.shape == (200,)
    assert activity.dtype == np.float32
    assert activity[60:140].mean() > 0.9
    assert activity[:45].max() == 0
    assert activity[170:].max() == 0
    assert activity.max() <= 1


@pytest.mark.parametrize("below", [6, 12, 20])
def test_music_is_no_speech(below: float) -> None:
    speech = np.concatenate([words(2), silence(2), words(2)])
    level = np.sqrt(np.mean(words(2) ** 2)) * 10 ** (-below / 20)
    activity = voice.voice_activity(speech + level * music(6))
    assert activity[115:185].mean() < 0.1  # the detector before called .4 to 1 of it speech
    assert np.concatenate([activity[10:90], activity[210:290]]).mean() > 0.9


def published_files() -> Path:
    """The folder of the published networks; it is not imported: that sets the number of threads."""
    package = find_spec("silero_vad")
    if package is None or package.origin is None:
        pytest.skip("silero-vad is not installed")
    return Path(package.origin).with_name("data")


def test_the_network_is_that_of_the_package() -> None:
    """Its own weights give the same in both: those of the TorchScript file, which are others."""
    data = published_files()
    assert VOICE_DETECTOR.read_bytes() == (data / "silero_vad_16k.safetensors").read_bytes()
    theirs = torch.jit.load(data / "silero_vad.jit").eval()
    state = {k.removeprefix("_model."): v for k, v in theirs.state_dict().items()}
    ours = voice_detector.VoiceDetector()
    weights = ours.state_dict()
    sources = ["stft.forward_basis_buffer"]
    sources += [f"encoder.{k}.reparam_conv.{kind}" for k in range(4) for kind in ("weight", "bias")]
    sources += [f"decoder.rnn.{part}" for part in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")]
    sources += ["decoder.decoder.2.weight", "decoder.decoder.2.bias"]
    ours.load_state_dict({k: state[s] for k, s in zip(weights, sources, strict=True)})
    sound = torch.from_numpy(words(2))[: 60 * voice_detector.CHUNK]
    with torch.no_grad():
        expected = theirs.audio_forward(sound[None], voice.SAMPLE_RATE)[0]
        padded = torch.nn.functional.pad(sound, (voice_detector.CONTEXT, 0))
        found, _ = ours(padded.unfold(0, 576, 512), None)
    torch.testing.assert_close(found, expected, atol=1e-4, rtol=0)
    assert expected.std() > 0.1


@pytest.mark.parametrize("gain", [0.003, 0.1, 4.0])
def test_level_does_not_matter(gain: float) -> None:
    sound = np.concatenate([silence(1), vowels(2), silence(1)])
    # Rounding to 16 bit inside the detector may turn a single step.
    difference = voice.voice_activity(sound * gain) - voice.voice_activity(sound)
    assert np.abs(difference).mean() < 0.01


def test_nothing_is_heard_in_nothing() -> None:
    assert voice.voice_activity(np.zeros(16_000, np.float32)).max() == 0
    assert voice.voice_activity(silence(1) * 0.1).max() == 0
    assert voice.voice_activity(np.zeros(0, np.float32)).shape == (0,)


def test_blocks_give_the_same_as_one_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(voice, "BLOCK_STEPS", 16)
    sound = np.concatenate([vowels(1.2345), silence(0.7)])
    whole = voice.voice_activity(sound)
    parts = voice.voice_activity_of_blocks(lambda: pieces(sound, (1, 7000, 333)))
    assert np.array_equal(whole, parts)


@pytest.mark.parametrize("samples", [1, 319, 320, 321, 320 * 40 + 5])
def test_windows_are_centred_on_their_step(samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(voice, "BLOCK_STEPS", 16)
    sound = np.arange(1, samples + 1, dtype=np.float32)
    stacked = np.concatenate(list(voice.step_windows(pieces(sound, (50, 411)), 512)))
    padded = np.concatenate([np.zeros(96), sound, np.zeros(1000)])
    expected = [padded[320 * t : 320 * t + 512] for t in range(voice.steps(samples))]
    assert np.array_equal(stacked, expected)


def test_window_that_cannot_be_centred() -> None:
    with pytest.raises(ValueError, match="centred"):
        list(voice.step_windows([], 321))


def test_interpolation_at_steps_and_between() -> None:
    series = np.array([1.0, 3.0, 5.0], np.float32)
    times = np.array([0.01, 0.03, 0.02, -1.0, 9.0])
    assert np.allclose(voice.at_times(series, times), [1, 3, 2, 0, 0], atol=1e-6)


def test_voice_at_the_middle_of_frames_of_any_rate() -> None:
    activity = np.zeros(100, np.float32)
    activity[50:] = 1
    for rate in (Fraction(25), Fraction(30000, 1001), Fraction(60)):
        frames = int(2 * rate)
        middle = (np.arange(frames) + 0.5) / float(rate)
        got = voice.at_times(activity, middle)
        clear = np.abs(middle - 1) > 0.02
        clear &= middle < 1.98
        assert np.array_equal(got[clear], (middle > 1)[clear].astype(np.float32))
