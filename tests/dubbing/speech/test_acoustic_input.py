"""The network's input: level, microphone and time."""

import numpy as np
import pytest
import torch

from dubbing.speech import acoustic_inference
from dubbing.speech import acoustic_input as front
from dubbing.speech import voice_activity as voice
from tests.dubbing.speech.test_voice_activity import pieces, silence, vowels

SPEECH = np.concatenate([silence(0.5), vowels(1.5), silence(0.3)])


def heard(samples: np.ndarray) -> torch.Tensor:
    return front.normalised(acoustic_inference.spectra_of([samples])[None].float())[0]


def test_shape_and_range() -> None:
    found = heard(SPEECH)
    assert found.shape == (voice.steps(len(SPEECH)), front.SPECTRA * front.BANDS)
    assert found.abs().max() <= 2.2
    assert found[40:90].mean() - found[5:20].mean() > 1.5


@pytest.mark.parametrize("gain", [0.01, 3.0])
def test_level_does_not_matter(gain: float) -> None:
    # Half precision of the kept spectra leaves differences of a thousandth.
    assert (heard(SPEECH * gain) - heard(SPEECH)).abs().max() < 0.02


def test_an_offset_of_the_samples_does_not_matter() -> None:
    assert (heard(SPEECH + 0.1) - heard(SPEECH))[30:90].abs().mean() < 0.02


def test_both_spectra_of_a_step_are_where_they_belong() -> None:
    sound = np.zeros(32_000, np.float32)
    sound[320 * 40 + 80] = 0.5
    energy = acoustic_inference.spectra_of([sound]).float().amax(2)
    # A click in the middle of the first half of step 40.
    assert energy.flatten().argmax() == 80


def test_training_and_listening_hear_alike() -> None:
    sound = torch.from_numpy(SPEECH[: len(SPEECH) // 320 * 320])[None]
    mel = front.log_mel(front.step_windows(sound), front.filters())
    assert (mel[0] - acoustic_inference.spectra_of([sound[0].numpy()]).float()).abs().max() < 0.01


def test_blocks_give_the_same_as_one_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(voice, "BLOCK_STEPS", 16)
    parts = acoustic_inference.spectra_of(pieces(SPEECH, (1, 5000, 321)))
    assert torch.equal(parts, acoustic_inference.spectra_of([SPEECH]))


def test_a_warp_above_one_hears_formants_higher() -> None:
    tone = np.zeros(front.FFT // 2 + 1, np.float32)
    tone[64] = 1  # 2 kHz
    bands = [int((torch.from_numpy(tone) @ front.filters(w)).argmax()) for w in (0.85, 1.0, 1.15)]
    assert bands[0] < bands[1] < bands[2]
