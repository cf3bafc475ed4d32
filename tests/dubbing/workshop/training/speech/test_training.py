"""Teaching: batches that repeat, a run that goes on exactly, weights that come back."""

from pathlib import Path

import numpy as np
import pytest
import torch

from dubbing.cli import main as cli
from dubbing.errors import ExplainedError, TrainingError
from dubbing.speech import acoustic_inference
from dubbing.speech.acoustic_network import AcousticNetwork
from dubbing.speech.acoustic_weights import load_model, save_model
from dubbing.speech.features import features_by_name, fingerprint
from dubbing.workshop.training.speech import augmentation, corpus, synthesis, training
from dubbing.workshop.training.speech.augmentation import Batches
from dubbing.workshop.training.speech.projection import project
from dubbing.workshop.training.speech.training import SpeechTraining, train_network
from tests import clips
from tests.dubbing.workshop.training.speech.made import parts, posteriors

pytestmark = pytest.mark.medium


SHORT = SpeechTraining(steps=3)


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(augmentation, "SECONDS", 1.0)
    monkeypatch.setattr(augmentation, "ITEMS", 3)
    monkeypatch.setattr(training, "SAVED_EVERY", 1)


def batches(seed: int) -> Batches:
    return Batches(parts(), np.random.default_rng(seed), items=6)


def test_batches_repeat_with_their_seed() -> None:
    a, b, other = batches(3).draw(), batches(3).draw(), batches(4).draw()
    assert torch.equal(a.spectra, b.spectra)
    assert not torch.equal(a.spectra, other.spectra)
    assert a.spectra.shape == (6, 50, 128)
    assert a.spectra.isfinite().all()
    assert a.senones.shape == (6, 50, 126)
    assert set(a.known.unique().tolist()) <= {0.0, 1.0}


def test_recordings_have_no_phones_and_voices_do() -> None:
    source = batches(0)
    seen = [source.draw() for _ in range(4)]
    expected = torch.cat([(b.phones > 0).any(1) for b in seen])
    shaped = torch.cat([b.lips.isfinite().all(-1).any(1) for b in seen])
    assert 0 < expected.sum() < len(expected)
    assert not (shaped & ~torch.cat([(b.phones >= 0).any(1) for b in seen])).any()


def quiet(message: str, share: float) -> None:
    pass


def test_a_killed_run_goes_on_exactly(tmp_path: Path) -> None:
    whole = train_network(parts(), SHORT, tmp_path / "a", quiet)

    class KilledError(Exception):
        pass

    kept = training._save

    def killing(*arguments: object) -> None:
        kept(*arguments)  # type: ignore[arg-type]
        raise KilledError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "_save", killing)
        with pytest.raises(KilledError):
            train_network(parts(), SHORT, tmp_path / "b", quiet)
    resumed = train_network(parts(), SHORT, tmp_path / "b", quiet)
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name
    assert not (tmp_path / "b").exists()


def test_another_run_is_not_continued(tmp_path: Path) -> None:
    def stop(message: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        saved = training._save

        def once(*arguments: object) -> None:
            saved(*arguments)  # type: ignore[arg-type]
            raise KeyboardInterrupt

        patch.setattr(training, "_save", once)
        with pytest.raises(KeyboardInterrupt):
            train_network(parts(), SHORT, tmp_path, stop)
    with pytest.raises(TrainingError, match="other settings"):
        train_network(parts(), SpeechTraining(steps=4), tmp_path, stop)


def test_weights_come_back(tmp_path: Path) -> None:
    torch.manual_seed(0)
    model = project(AcousticNetwork(), parts(), every=1, dim=12)
    save_model(model, tmp_path / "w.safetensors", {"steps": 0})
    back = load_model(tmp_path / "w.safetensors")
    assert back.dim == 12
    sound = torch.randn(1, 30, 128)
    with torch.no_grad():
        before, after = (m.features(m.network(sound)) for m in (model, back))
    assert (before - after).abs().max() < 0.05 * before.abs().max()


def test_features_are_scaled_in_speech() -> None:
    torch.manual_seed(0)
    model = project(AcousticNetwork(), parts()[:1], every=1, dim=12)
    made = parts()[0].utterances[0]
    spectra = acoustic_inference.spectra_of([made.samples.astype(np.float32) / 32768])
    found = acoustic_inference.run_network(model.network, spectra, model.features)
    assert np.sqrt((found[made.classes != 0] ** 2).mean()) == pytest.approx(0.7, rel=0.1)


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "damaged").write_bytes(b"no weights")
    with pytest.raises(ExplainedError, match="cannot be read"):
        load_model(tmp_path / "damaged")
    with pytest.raises(ExplainedError, match="cannot be read"):
        load_model(tmp_path / "missing")
    from safetensors.torch import save_file

    save_file({"x": torch.zeros(1)}, tmp_path / "other")
    with pytest.raises(ExplainedError, match="not weights of our speech network"):
        load_model(tmp_path / "other")


def test_weights_are_made_from_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command: corpus, training and weights that the features can be made with."""
    voice = synthesis.espeak_voice("en-us")
    monkeypatch.setattr(corpus, "training_voices", lambda amounts: [(voice, 6.0)])
    monkeypatch.setattr(corpus, "senone_posteriors", posteriors)
    clips.write_sound(tmp_path / "someone.wav", 2)
    out = tmp_path / "speech.safetensors"
    call = ["train-speech", str(out), "--recording", str(tmp_path / "someone.wav"), "--steps", "2"]
    monkeypatch.setattr("sys.argv", ["dfrf", *call])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 0
    assert "wrote" in capsys.readouterr().out
    made = sorted(path.name for path in (tmp_path / "speech.safetensors.corpus").iterdir())
    assert made == ["espeak-en-us.safetensors", "real-someone.safetensors"]
    assert not out.with_name("speech.safetensors.resume").exists()
    rnn = features_by_name("rnn", out)
    assert rnn.extract(np.zeros(3200, np.float32)).shape == (10, rnn.dim)
    assert fingerprint("rnn", out) != fingerprint("rnn")
