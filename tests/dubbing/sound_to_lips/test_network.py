"""The lip network's shapes, pieces and file; what ships with the package."""

from pathlib import Path

import numpy as np
import pytest
import torch

from dubbing.errors import DubbingError
from dubbing.sound_to_lips import predict as predicting
from dubbing.sound_to_lips.network import CLOSED, HIDDEN, OUTPUTS, SENONES, Member
from dubbing.sound_to_lips.predict import lips_of, predict
from dubbing.sound_to_lips.weights import DEFAULT_WEIGHTS, load, save
from dubbing.speech.voice_activity import SAMPLE_RATE
from tests.dubbing.training.lips.made import TINY, network


def noise(steps: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    activations = rng.standard_normal((steps, HIDDEN + SENONES)).astype(np.float32)
    return activations, np.ones(steps, np.float32)


@pytest.mark.parametrize("steps", [1, 2, 31, 60])
def test_there_is_an_answer_for_every_step(steps: int) -> None:
    member = Member(64, TINY).eval()
    assert member(torch.zeros(2, steps, 64)).shape == (2, steps, OUTPUTS)
    found = lips_of(network().eval(), *noise(steps))
    assert found.lips.shape == (steps, CLOSED)
    assert found.closed.shape == (steps,)
    assert found.table().shape == (steps, CLOSED + 1)


def test_a_long_sound_in_pieces_has_the_lips_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    net = network().eval()
    whole = lips_of(net, *noise(700)).table()
    monkeypatch.setattr(predicting, "PIECE", 200)
    parts = lips_of(net, *noise(700)).table()
    # The members' norms look at all there is of a piece.
    assert np.corrcoef(whole[:, 0], parts[:, 0])[0, 1] > 0.99


def test_another_number_of_values_is_refused() -> None:
    with pytest.raises(ValueError, match="values a step"):
        network()(torch.zeros(1, 5, 64), torch.ones(1, 5))


def test_what_is_kept_says_the_same(tmp_path: Path) -> None:
    net = network().eval()
    save(net, tmp_path / "lips.safetensors", {"clips": []})
    again = load(tmp_path / "lips.safetensors")
    one, other = lips_of(net, *noise(50)).table(), lips_of(again, *noise(50)).table()
    np.testing.assert_allclose(one, other, atol=5e-3)


def test_other_weights_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DubbingError):
        load(tmp_path / "none.safetensors")


def test_the_shipped_weights_are_small_and_hear_a_sound() -> None:
    assert DEFAULT_WEIGHTS.stat().st_size < 4e6
    rng = np.random.default_rng(0)
    loud = np.repeat(rng.random(20) > 0.5, SAMPLE_RATE // 10)
    sound = (0.1 * rng.standard_normal(2 * SAMPLE_RATE) * loud).astype(np.float32)
    found = predict(lambda: [sound])
    assert found.lips.shape == (100, CLOSED)
    assert np.isfinite(found.table()).all()
    assert np.abs(found.table()).max() < 20
    assert len(predict(lambda: []).lips) == 0
