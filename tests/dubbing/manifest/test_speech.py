"""Speech features in a manifest, and their weights."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dubbing.batch import jobs
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS
from tests.dubbing.manifest.made import GOOD, problems, read


def with_speech(keys: str) -> str:
    return GOOD.replace("seconds: 2,", f"seconds: 2, {keys},")


def test_speech_features_and_their_weights(folder: Path) -> None:
    (folder / "hubert").mkdir(exist_ok=True)
    (folder / "hubert" / "config.json").write_text('{"model_type": "hubert"}')
    (folder / "hubert" / "model.safetensors").write_bytes(b"")
    host = read(folder, with_speech("speech: hubert, speech_weights: hubert")).identities["host"]
    assert host.speech_weights == (folder / "hubert").resolve()
    assert read(folder, with_speech("speech: rnn")).identities["host"].speech_weights is None


def test_results_depend_on_the_weights_of_the_features(folder: Path) -> None:
    """Other weights: the person is learned, and the sound heard, again."""
    built = jobs.build(read(folder, with_speech("speech: rnn")))
    stages = [built.identities["host"].stages["finetune"], built.dubs["host_it"].stages["listen"]]
    assert [stage.inputs["speech_weights"] for stage in stages] == [DEFAULT_WEIGHTS] * 2
    mel = jobs.build(read(folder, with_speech("speech: mel"))).identities["host"].stages["finetune"]
    assert "speech_weights" not in mel.inputs


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
