"""Speech features in a manifest, and their weights."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dfrf import presets
from dfrf.saved_models import save_model
from dubbing.batch import jobs
from dubbing.errors import ManifestError
from dubbing.manifest.manifest import load
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS
from dubbing.stages.finetune import Finetune
from dubbing.stages.listen import Listen
from tests.dfrf.people import small_config
from tests.dubbing.manifest.made import GOOD, problems, read


def with_speech(keys: str) -> str:
    return GOOD.replace("seconds: 2,", f"seconds: 2, {keys},")


def test_speech_features_and_their_weights(folder: Path) -> None:
    (folder / "hubert").mkdir(exist_ok=True)
    (folder / "hubert" / "config.json").write_text('{"model_type": "hubert"}')
    (folder / "hubert" / "model.safetensors").write_bytes(b"")
    host = read(folder, with_speech("speech: hubert, speech_weights: hubert")).people["host"]
    assert host.settings.weights == (folder / "hubert").resolve()
    assert read(folder, with_speech("speech: rnn")).people["host"].settings.weights is None


def test_results_depend_on_the_weights_of_the_features(folder: Path) -> None:
    """Other weights: the person is learned, and the sound heard, again."""
    built = jobs.build(read(folder, with_speech("speech: rnn")))
    host, dub = built.by_label["identity/host"], built.by_label["dub/host_it"]
    stages = [host.stage(Finetune), *dub.all_of(Listen)]
    assert [stage.inputs["weights features"] for stage in stages] == [DEFAULT_WEIGHTS] * 2
    mel = jobs.build(read(folder, with_speech("speech: mel"))).by_label[host.label].stage(Finetune)
    assert "weights features" not in mel.inputs


def test_people_are_not_learned_from_a_base_that_hears_something_else(folder: Path) -> None:
    path = folder / "m.yaml"
    (folder / "hubert").mkdir(exist_ok=True)
    (folder / "hubert" / "config.json").write_text('{"model_type": "hubert"}')
    (folder / "hubert" / "model.safetensors").write_bytes(b"")
    save_model(folder / "mel.safetensors", presets.build(small_config()), {"speech": "mel"})
    shipped = "the base that comes with this tool hears rnn"
    cases = {
        "speech: mel": f"{shipped}, but the identity has speech: mel",
        "speech: hubert, speech_weights: hubert": "name a base of hubert",
        "speech: rnn, base: mel.safetensors": "mel.safetensors hears mel",
        "speech: rnn, speech_weights: it.wav": "was trained with other weights of rnn",
        "speech: mel, base: mel.safetensors": "",
        "speech: mel, preset: nerf": "",
        "speech: rnn": "",
    }
    for keys, message in cases.items():
        path.write_text(with_speech(keys))
        load(path)  # a base can be trained of these people
        if message:
            with pytest.raises(ManifestError, match=re.escape(message)):
                load(path, from_base=True)
        else:
            load(path, from_base=True)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("speech: whale", "identities.host.speech: .*'mel'"),
        ("speech: hubert", "identities.host.speech: .*need weights of your own"),
        ("speech: hubert, speech_weights: gone", "host.speech_weights: no hubert weights there"),
        ("speech: deepspeech", "identities.host.speech: .*output_graph.pb of DeepSpeech 0.1.0"),
        ("speech: deepspeech, speech_weights: gone.pb", "host.speech_weights: no such file"),
        ("speech: mel, speech_weights: it.wav", "host.speech_weights: mel features have no"),
        ("speech: rnn, speech_weights: gone.safetensors", "speech_weights: no such file"),
    ],
)
def test_speech_that_cannot_be_heard(folder: Path, keys: str, message: str) -> None:
    (found,) = problems(folder, with_speech(keys))
    assert re.search(message, found)
