"""Lips of a sound: its steps, its level, its pieces, and the files that ship with the package."""

from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from dfrf.field.speaker_adaptation import NUMBERS, PREDICTED
from dubbing.errors import ExplainedError
from dubbing.sound_to_lips import encoder as encoding
from dubbing.sound_to_lips import predict as predicting
from dubbing.sound_to_lips.encoder import CHANNELS, STEP, SpeechEncoder, encode
from dubbing.sound_to_lips.lip_network import FILTER_FORMAT, LipFilter, load, load_encoder, save
from dubbing.sound_to_lips.predict import predict
from dubbing.speech.voice_activity import SAMPLE_RATE


@lru_cache
def shipped() -> SpeechEncoder:
    """The encoder as it ships."""
    return load_encoder()


def sound(seconds: float, seed: int = 0) -> np.ndarray:
    """Noise that comes and goes."""
    rng = np.random.default_rng(seed)
    count = round(seconds * SAMPLE_RATE)
    loud = np.repeat(rng.random(int(seconds * 10) + 1) > 0.5, SAMPLE_RATE // 10)[:count]
    return (0.1 * rng.standard_normal(count) * loud).astype(np.float32)


@pytest.mark.parametrize("samples", [1, STEP, STEP + 1, 20_000])
def test_every_step_of_a_sound_is_encoded(samples: int) -> None:
    found = encode(shipped(), [np.zeros(samples, np.float32)], 1.0)
    assert found.shape == (-(-samples // STEP), CHANNELS)


def test_blocks_do_not_matter() -> None:
    whole, encoder = sound(3), shipped()
    parts = [whole[:100], whole[100:7777], whole[7777:]]
    assert torch.equal(encode(encoder, [whole], 1.0), encode(encoder, parts, 1.0))


def test_a_long_sound_in_pieces_is_encoded_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, encoder = sound(8), shipped()
    at_once = encode(encoder, [whole], 1.0)
    monkeypatch.setattr(encoding, "PIECE", 120)
    parts = encode(encoder, [whole], 1.0)
    assert parts.shape == at_once.shape
    # A piece sees less of the sound, so its norms differ a little.
    assert np.corrcoef(at_once.flatten(), parts.flatten())[0, 1] > 0.99


def test_the_place_of_a_sound_moves_its_steps_with_it() -> None:
    late, whole = 10, sound(3)
    one = encode(shipped(), [whole], 1.0)
    moved = encode(shipped(), [np.concatenate([np.zeros(late * STEP, np.float32), whole])], 1.0)

    def apart(steps: int) -> float:
        return float((one[20:100] - moved[20 + steps : 100 + steps]).square().mean())

    assert apart(late) < 0.1 * min(apart(late - 1), apart(late + 1))


def test_the_level_does_not_matter() -> None:
    quiet, loud = predict(lambda: [0.05 * sound(3)]), predict(lambda: [sound(3)])
    np.testing.assert_allclose(quiet, loud, atol=1e-3)


def test_a_sound_has_lips_fifty_times_a_second() -> None:
    found = predict(lambda: [sound(2)])
    assert found.shape == (100, NUMBERS)
    assert np.isfinite(found).all()
    assert np.abs(found).max() < 20
    assert predict(lambda: []).shape == (0, NUMBERS)


def test_lips_are_those_of_the_middle_of_their_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """A network that answers with the second that it hears: not half a step earlier or later."""

    def heard(_network: object, blocks: list[np.ndarray], _gain: float) -> torch.Tensor:
        steps = -(-sum(map(len, blocks)) // STEP)
        seconds = (torch.arange(steps) + 0.5) * STEP / SAMPLE_RATE
        return seconds[:, None].repeat(1, NUMBERS)

    monkeypatch.setattr(predicting, "encode", heard)
    monkeypatch.setattr(
        predicting, "_network", lambda: SimpleNamespace(filter=lambda x: x, encoder=0)
    )
    found = predict(lambda: [sound(2)])
    middle = (np.arange(100) + 0.5) / 50
    np.testing.assert_allclose(found[1:, 0], middle[1:], atol=STEP / SAMPLE_RATE / 100)


def test_silence_has_lips_that_do_not_move() -> None:
    still = predict(lambda: [np.zeros(3 * SAMPLE_RATE, np.float32)])[25:-25, :PREDICTED]
    assert still.std(0).max() < 0.3


def test_what_is_kept_says_the_same(tmp_path: Path) -> None:
    torch.manual_seed(0)
    made = LipFilter()
    save(made, tmp_path / "filter.safetensors", FILTER_FORMAT, {"clips": []})
    again = load(tmp_path / "filter.safetensors").filter
    x = torch.randn(50, CHANNELS)
    assert torch.allclose(made(x), again(x), atol=5e-2)


def test_other_weights_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ExplainedError):
        load(tmp_path / "none.safetensors")
    save(torch.nn.Linear(2, 2), tmp_path / "other.safetensors", FILTER_FORMAT, {})
    with pytest.raises(ExplainedError, match="do not fit"):
        load(tmp_path / "other.safetensors")
