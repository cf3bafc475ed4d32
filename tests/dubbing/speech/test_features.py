"""Speech features: level, blocks, time, and the windows at the video rate."""

from fractions import Fraction

import numpy as np
import pytest

from dubbing.errors import ExplainedError
from dubbing.speech import voice_activity as voice
from dubbing.speech.features import features_by_name, windows
from dubbing.speech.mel_features import MelFeatures, mel_filters
from tests.dubbing.speech.test_voice_activity import pieces, silence, vowels

SPEECH = np.concatenate([silence(0.5), vowels(1.5), silence(0.3)])


def test_shape_and_range() -> None:
    features = features_by_name("mel")
    mel = features.extract(SPEECH)
    assert features.dim == 80
    assert mel.shape == (voice.steps(len(SPEECH)), 80)
    assert mel.dtype == np.float32
    assert mel[5:20].mean() < 0.15, "noise far below the voice is near silence"
    assert 0.6 < mel[30:90].mean() < 1.2
    assert features.extract(np.zeros(0, np.float32)).shape == (0, 80)
    assert features.extract(np.zeros(999, np.float32)).shape == (4, 80)


@pytest.mark.parametrize("gain", [0.002, 0.3, 5.0])
def test_level_does_not_matter(gain: float) -> None:
    mel = MelFeatures()
    assert np.allclose(mel.extract(SPEECH * gain), mel.extract(SPEECH), atol=2e-3)


def test_microphone_matters_little() -> None:
    """A high-frequency loss of 12 dB changes the features by much less than it is."""
    spectrum = np.fft.rfft(SPEECH)
    loss = 10 ** (-0.6 * np.linspace(0, 1, len(spectrum)))
    dull = np.fft.irfft(spectrum * loss, len(SPEECH)).astype(np.float32)
    mel = MelFeatures()
    change = np.abs(mel.extract(dull) - mel.extract(SPEECH))[30:90].mean()
    uncorrected = 1.2 / 2 / mel._range
    assert change < 0.5 * uncorrected


def test_blocks_give_the_same_as_one_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(voice, "BLOCK_STEPS", 16)
    mel = MelFeatures()
    parts = mel.extract_blocks(lambda: pieces(SPEECH, (1, 5000, 321)))
    assert np.array_equal(mel.extract(SPEECH), parts)


def test_a_click_is_heard_at_its_step() -> None:
    sound = silence(1)
    sound[320 * 20 + 160] = 0.5
    mel = MelFeatures().extract(sound)
    assert int(mel.sum(1).argmax()) == 20


def test_filters_cover_every_band_and_have_one_area() -> None:
    filters = mel_filters(80, 512, 16_000)
    assert filters.shape == (80, 257)
    assert (filters.max(1) > 0).all()
    # Area in hertz; the narrow low bands see few bins, hence from band 30 on.
    assert np.allclose(filters[30:].sum(1) * 16_000 / 512, 1, atol=0.12)
    peaks = filters.argmax(1) * 16_000 / 512
    assert (np.diff(peaks) >= 0).all()


def test_windows_at_25_fps_are_the_steps_themselves() -> None:
    steps = np.arange(1, 101, dtype=np.float32)[:, None]
    got = windows(steps, (np.arange(50) + 0.5) / 25)
    assert got.shape == (50, 16, 1)
    # Frame i is centred on the edge between steps 2i and 2i+1.
    for i in (4, 20, 45):
        assert np.allclose(got[i, :, 0], steps[2 * i - 7 : 2 * i + 9, 0], atol=1e-3)
    assert np.allclose(got[0, :, 0], [0] * 7 + list(range(1, 10)), atol=1e-3)
    assert np.allclose(got[49, :, 0], list(range(92, 101)) + [0] * 7, atol=1e-3)


@pytest.mark.parametrize("rate", [Fraction(24), Fraction(30000, 1001), Fraction(50)])
def test_windows_are_centred_at_any_rate(rate: Fraction) -> None:
    seconds = (np.arange(500, dtype=np.float32)[:, None] + 0.5) / 50
    frames = int(10 * rate)
    middle = (np.arange(frames) + 0.5) / float(rate)
    got = windows(seconds, middle)[:, :, 0]
    inner = slice(int(rate), frames - int(rate))
    assert np.allclose(got.mean(1)[inner], middle[inner], atol=1e-4)
    assert np.allclose(np.diff(got, axis=1)[inner], 0.02, atol=1e-4)


def test_windows_in_pieces() -> None:
    steps = np.random.default_rng(1).normal(size=(90, 3)).astype(np.float32)
    middle = (np.arange(53) + 0.5) / float(Fraction(30000, 1001))
    whole = windows(steps, middle)
    assert np.array_equal(whole[20:40], windows(steps, middle[20:40]))


def test_unknown_name_lists_what_there_is() -> None:
    with pytest.raises(ExplainedError, match="mel"):
        features_by_name("whale")
