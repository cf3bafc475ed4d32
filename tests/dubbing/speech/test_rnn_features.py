"""The features of our network: silence, level, blocks, other recordings of the same words."""

from pathlib import Path

import numpy as np
import pytest
import soundfile
from scipy.signal import resample_poly

from dubbing.speech import acoustic_inference
from dubbing.speech import voice_activity as voice
from dubbing.speech.features import features_by_name, features_of_file, windows
from dubbing.speech.rnn_features import RnnFeatures, voice_gate
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS
from dubbing.workshop.training.speech.evaluation import cosine
from tests.dubbing.speech.test_voice_activity import pieces, silence
from tests.dubbing.workshop.training.speech.made import spoken

pytestmark = pytest.mark.medium


LINE = "my father bought five yellow maps, and we move them away"


@pytest.fixture(scope="module")
def rnn() -> RnnFeatures:
    return RnnFeatures()


@pytest.fixture(scope="module")
def sound() -> np.ndarray:
    return np.concatenate([silence(0.6), 0.3 * spoken(LINE).samples, silence(0.6)])


def test_shipped_weights_are_small() -> None:
    assert DEFAULT_WEIGHTS.stat().st_size <= 6_000_000


def test_shape_and_scale(rnn: RnnFeatures, sound: np.ndarray) -> None:
    found = rnn.extract(sound)
    assert found.shape == (voice.steps(len(sound)), rnn.dim)
    assert found.dtype == np.float32
    assert 0.4 < np.sqrt((found[50:-50] ** 2).mean()) < 1.2
    assert features_by_name("rnn").dim == rnn.dim <= 128
    assert rnn.extract(np.zeros(0, np.float32)).shape == (0, rnn.dim)
    assert rnn.extract(np.zeros(999, np.float32)).shape == (4, rnn.dim)


def test_pauses_are_exactly_silent(rnn: RnnFeatures) -> None:
    """Speech, 2 s of silence, speech: 0 well inside the pause, and smooth on the way there."""
    sentence = 0.3 * spoken(LINE).samples
    found = rnn.extract(np.concatenate([sentence, silence(2), sentence]))
    middle = voice.steps(len(sentence))
    assert (found[middle + 20 : middle + 80] == 0).all()
    assert np.abs(found[10 : middle - 10]).max(1).min() > 0
    steps = np.abs(np.diff(found, axis=0)).max(1)
    assert steps[middle - 10 : middle + 30].max() < steps[: middle - 10].max()


def test_silence_alone_is_silent(rnn: RnnFeatures) -> None:
    assert (rnn.extract(silence(2)) == 0).all()
    assert (rnn.extract(np.zeros(16_000, np.float32)) == 0).all()


def test_the_window_in_a_pause_is_silent(rnn: RnnFeatures) -> None:
    sentence = 0.3 * spoken(LINE).samples
    found = rnn.extract(np.concatenate([sentence, silence(2), sentence]))
    assert (windows(found, np.array([len(sentence) / 16_000 + 1])) == 0).all()


@pytest.mark.parametrize("gain", [0.01, 0.2, 3.0])
def test_level_does_not_matter(rnn: RnnFeatures, sound: np.ndarray, gain: float) -> None:
    assert cosine(rnn.extract(sound), rnn.extract(sound * gain)) > 0.995


def test_an_offset_of_the_samples_does_not_matter(rnn: RnnFeatures, sound: np.ndarray) -> None:
    assert cosine(rnn.extract(sound), rnn.extract(sound + 0.05)) > 0.97


def test_clipping_is_survived(rnn: RnnFeatures, sound: np.ndarray) -> None:
    limit = 0.25 * np.abs(sound).max()
    assert cosine(rnn.extract(sound), rnn.extract(sound.clip(-limit, limit))) > 0.85


def test_blocks_give_the_same_as_one_piece(
    rnn: RnnFeatures, sound: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(voice, "BLOCK_STEPS", 64)
    parts = rnn.extract_blocks(lambda: pieces(sound, (1, 9000, 321)))
    assert np.array_equal(parts, rnn.extract(sound))


def test_long_sounds_are_heard_in_pieces(
    rnn: RnnFeatures, sound: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pieces with enough around them hear what is heard in one go."""
    whole = rnn.extract(sound)
    monkeypatch.setattr(acoustic_inference, "PIECE", 60)
    monkeypatch.setattr(acoustic_inference, "AROUND", 50)
    assert cosine(whole, rnn.extract(sound)) > 0.999


@pytest.mark.parametrize(
    ("rate", "channels", "subtype", "least"),
    [
        (8000, 1, "PCM_16", 0.8),
        (44_100, 2, "PCM_16", 0.97),
        (48_000, 1, "FLOAT", 0.97),
        (16_000, 3, "PCM_24", 0.97),
    ],
)
def test_recordings_of_any_kind(
    rnn: RnnFeatures,
    sound: np.ndarray,
    tmp_path: Path,
    rate: int,
    channels: int,
    subtype: str,
    least: float,
) -> None:
    common = int(np.gcd(rate, voice.SAMPLE_RATE))
    other = resample_poly(sound, rate // common, voice.SAMPLE_RATE // common)
    file = tmp_path / "recording.wav"
    soundfile.write(file, np.repeat(other[:, None], channels, 1), rate, subtype=subtype)
    found, activity = features_of_file(file, rnn)
    assert abs(len(found) - voice.steps(len(sound))) <= 1
    assert len(found) == len(activity)
    assert cosine(rnn.extract(sound), found) > least


def test_gate() -> None:
    activity = np.zeros(100, np.float32)
    activity[40:60] = 1
    gate = voice_gate(activity)
    assert gate.shape == (100,)
    assert (gate[38:62] == 1).all()
    assert (gate[:29] == 0).all()
    assert (gate[71:] == 0).all()
    assert (np.diff(gate[:50]) >= 0).all()
    assert np.abs(np.diff(gate)).max() < 0.3
