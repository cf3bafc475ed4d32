from __future__ import annotations

import os
import re
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile
from safetensors.numpy import save_file

from dfrf.config import STEPS
from dubbing import pipeline
from dubbing.engine.stage import Stage
from dubbing.errors import ManifestError
from dubbing.files import atomic_path
from dubbing.manifest import yaml_lines
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.manifest import Manifest, load
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS
from tests import clips


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("manifest")
    clips.write_clip(place / "host.mp4", 75)
    clips.write_video(place / "silent.mp4", 75)
    clips.write_sound(place / "it.wav", 2)
    (place / "damaged.mp4").write_bytes(b"this is no video")
    return place


CONSENT = '{by: "the person on film", reference: "form 17"}'
GOOD = f"""
version: 1
output: out
identities:
  host: {{clip: host.mp4, seconds: 2, consent: {CONSENT}}}
dubs:
  - {{identity: host, audio: it.wav}}
"""


def read(folder: Path, text: str) -> Manifest:
    path = folder / "m.yaml"
    path.write_text(textwrap.dedent(text).lstrip("\n"))
    return load(path)


def problems(folder: Path, text: str) -> list[str]:
    with pytest.raises(ManifestError) as caught:
        read(folder, text)
    return [str(problem) for problem in caught.value.problems]


def test_a_good_manifest(folder: Path) -> None:
    manifest = read(folder, GOOD)
    host, (dub,) = manifest.identities["host"], manifest.dubs
    assert manifest.output == (folder / "out").resolve()
    assert host.clip == (folder / "host.mp4").resolve()
    assert (host.preset, host.seed, host.start, host.finetune.iterations) == ("fast", 0, 0, None)
    assert dub.name == "host_it"
    assert (dub.on_longer_audio, dub.frame, dub.label, dub.codec) == (
        "bounce",
        "full",
        True,
        "h264",
    )
    assert manifest.media[host.clip].frames == 75


def test_defaults_reach_identities_and_dubs_and_can_be_overruled(folder: Path) -> None:
    manifest = read(
        folder,
        f"""
        version: 1
        output: out
        defaults: {{preset: nerf, seed: 7, label: false, finetune: {{iterations: 9}}, start: 0.5}}
        identities:
          a: {{clip: host.mp4, consent: {CONSENT}, seconds: 1}}
          b:
            {{clip: host.mp4, consent: {CONSENT}, seconds: 1, seed: 8, finetune: {{iterations: 5}}}}
        dubs:
          - {{identity: a, audio: it.wav}}
          - {{identity: b, audio: it.wav, label: true, name: other}}
        """,
    )
    a, b = manifest.identities["a"], manifest.identities["b"]
    assert (a.preset, a.seed, a.start, a.finetune.iterations) == ("nerf", 7, 0.5, 9)
    assert (b.preset, b.seed, b.finetune.iterations) == ("nerf", 8, 5)
    assert [d.label for d in manifest.dubs] == [False, True]


def test_everything_wrong_is_said_at_once_with_key_and_line(folder: Path) -> None:
    found = problems(
        folder,
        """
        version: 2
        outptu: x
        defaults: {preset: quick, sed: 1}
        identities:
          host:
            clip: it.wav
            start: soon
            consent: {by: "", dat: 3}
          ../evil:
            clip: nothing.mp4
            consent: {by: "a", reference: "b"}
          mute: {clip: silent.mp4, consent: {by: a, reference: b}}
        dubs:
          - {identity: host, audio: silent.mp4}
          - {identity: nobody, audio: 3, name: ../x}
          - {identity: mute, audio: it.wav, name: a, frame: half, audio_start: 70}
          - {identity: mute, audio: it.wav, name: A, label: "no", video_start: 9}
          - text
        """,
    )
    expected = [
        "line 1: output: is required",
        "line 1: version: must be 1",
        "line 2: outptu: unknown key; did you mean 'output'?",
        "line 3: defaults.preset: must be one of 'fast', 'paper', 'ad-nerf' or 'nerf'",
        "line 3: defaults.sed: unknown key; did you mean 'seed'?",
        "line 6: identities.host.clip: no picture in",
        "line 7: identities.host.start: must be a valid number, not 'soon'",
        "line 8: identities.host.consent.by: must not be empty",
        "line 8: identities.host.consent.dat: unknown key; did you mean 'date'?",
        "line 8: identities.host.consent.reference: is required",
        "line 9: identities.../evil: the name would leave the output folder",
        "line 10: identities.../evil.clip: no such file",
        "line 12: identities.mute.clip: no sound in",
        "line 14: dubs[0].audio: no sound in",
        "line 15: dubs[1].audio: must be the path of a file",
        "line 15: dubs[1].identity: no identity 'nobody'; there is host, ../evil, mute",
        "line 15: dubs[1].name: would leave the output folder",
        "line 16: dubs[2].audio_start: 70 s is past the end: the sound is 2.0 s long",
        "line 16: dubs[2].frame: must be one of 'full' or 'crop', not 'half'",
        "line 17: dubs[3].label: must be true or false, not 'no'",
        "line 17: dubs[3].name: the name 'A' is taken by dubs[2].name (line 16)",
        "line 17: dubs[3].video_start: 9 s is past the end: the last frame of the clip is at 2.96",
        "line 18: dubs[4]: must hold keys, not text",
    ]
    assert len(found) == len(expected), "\n".join(found)
    for said, wanted in zip(found, expected, strict=True):
        assert said.startswith(wanted)


def test_consent_is_required(folder: Path) -> None:
    text = GOOD.replace(f", consent: {CONSENT}", "")
    assert problems(folder, text) == ["line 4: identities.host.consent: is required"]


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("a: [", "not valid YAML"),
        ("version: !!python/object/apply:os.system [ls]", "not valid YAML"),
        ("a: &a [*a, *a]", "not valid YAML"),
        ("", "must hold version, output, identities and dubs"),
        ("- 1", "must hold version, output, identities and dubs"),
        ("version: 1\nversion: 1", "version: given twice"),
        ("version: 1\n1: x", "the key '1' is not text"),
        ("version: true\noutput: out\nidentities: {}", "version: must be 1"),
        ("version: 1\noutput: out\nidentities: {}", "identities: names nobody"),
        ("version: 1\noutput: out", "identities: is required"),
        ("version: 1\noutput: out\nidentities: [a]", "identities: must be a mapping"),
        ("version: 1\noutput: host.mp4", "is a file, not a folder"),
        ("version: 1\noutput: host.mp4/out", "line 2: output: .*host.mp4 is a file, not a folder"),
        (
            "version: 1\noutput: ~no_such_user/x",
            "line 2: output: cannot be a path: Could not determine",
        ),
        ('version: 1\noutput: "a\\0b"', "line 2: output: cannot be a path: embedded null"),
        (f"version: 1\noutput: {'x' * 300}", "line 2: output: cannot be a path: File name too"),
        ("version: 1\nb: \x07", "line 2: not valid YAML: the character '.x07' is not allowed"),
        ("version: 1\na: " + "[" * 3000, "line 2: not valid YAML: too many brackets"),
        ('version: 1\na: {b: !!int "c"}', "line 2: not valid YAML: a.b 'c' cannot be read as int"),
        ("version: 1\na: !!bool x", "line 2: not valid YAML: a 'x' cannot be read as bool"),
    ],
)
def test_what_is_no_manifest(folder: Path, written: str, said: str) -> None:
    assert any(re.search(said, problem) for problem in problems(folder, written))


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("~no_such_user/x.mp4", "Could not determine home directory"),
        ("x" * 300, "File name too long"),
        ("a\\0b", "embedded null byte"),
    ],
)
def test_what_cannot_be_a_path(folder: Path, path: str, said: str) -> None:
    text = GOOD.replace("host.mp4", f'"{path}"')
    found = problems(folder, text)
    assert len(found) == 1
    assert found[0].startswith(f"line 4: identities.host.clip: cannot be a path: {said}")


def test_aliases_cannot_explode(folder: Path) -> None:
    text = "a: &a0 [x, x]\n"
    text += "".join(f"b{k}: &a{k + 1} [*a{k}, *a{k}, *a{k}, *a{k}]\n" for k in range(20))
    assert any("too many" in problem for problem in problems(folder, text))


@pytest.mark.parametrize("name", ["..", ".hidden", "a/b", "a\\\\b", "", " x", "C:x", "x" * 101])
def test_names_stay_in_the_output_folder(folder: Path, name: str) -> None:
    text = GOOD.replace("{identity: host,", f'{{name: "{name}", identity: host,')
    assert all("dubs[0].name" in problem for problem in problems(folder, text))


def test_a_dub_begins_with_a_frame_that_there_is(folder: Path) -> None:
    """75 frames at 25 a second: frame 74 is at 2.96 s, and times are rounded to the next frame."""
    for start, fits in ((2.97, True), (2.99, False)):
        text = GOOD.replace("audio: it.wav", f"audio: it.wav, video_start: {start}")
        if fits:
            read(folder, text)
        else:
            (said,) = problems(folder, text)
            assert said.startswith("line 6: dubs[0].video_start: 2.99 s is past the end")


def test_two_dubs_need_two_names(folder: Path) -> None:
    text = GOOD + "  - {identity: host, audio: it.wav, audio_start: 1}\n"
    (said,) = problems(folder, text)
    assert said.startswith("line 7: dubs[1].name: the name 'host_it' is taken by dubs[0].name")


def test_a_missing_manifest(tmp_path: Path) -> None:
    with pytest.raises(ManifestError, match="no such file"):
        load(tmp_path / "none.yaml")


def test_a_damaged_file_is_no_mistake_of_the_manifest(folder: Path) -> None:
    manifest = read(folder, GOOD.replace("host.mp4", "damaged.mp4"))
    assert list(manifest.damaged) == [(folder / "damaged.mp4").resolve()]


def test_a_clip_shorter_than_asked_is_used_whole_and_said(folder: Path) -> None:
    manifest = read(folder, GOOD.replace("seconds: 2", "seconds: 20"))
    assert any("learns from 3.0 s" in warning for warning in manifest.warnings)


def test_date_of_consent(folder: Path) -> None:
    text = GOOD.replace('"form 17"', '"form 17", date: 2026-11-02')
    assert str(read(folder, text).identities["host"].consent.date) == "2026-11-02"
    (said,) = problems(folder, text.replace("2026-11-02", "yesterday"))
    assert said.startswith("line 4: identities.host.consent.date")
    (said,) = problems(folder, text.replace("2026-11-02", "2026-13-45"))
    assert said.startswith("line 4: not valid YAML: identities.host.consent.date '2026-13-45'")


def with_speech(keys: str) -> str:
    return GOOD.replace("seconds: 2,", f"seconds: 2, {keys},")


def test_speech_features_and_their_weights(folder: Path) -> None:
    (folder / "hubert").mkdir(exist_ok=True)
    (folder / "hubert" / "config.json").write_text('{"model_type": "hubert"}')
    (folder / "hubert" / "model.safetensors").write_bytes(b"")
    host = read(folder, with_speech("speech: hubert, speech_weights: hubert")).identities["host"]
    assert host.speech_weights == (folder / "hubert").resolve()
    assert read(folder, with_speech("speech: rnn")).identities["host"].speech_weights is None


def test_a_changed_number_of_steps_is_seen(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stage() -> Stage:
        return pipeline.build(read(folder, GOOD)).identities["host"].stages["finetune"]

    before = stage()
    assert before.parameters["iterations"] == STEPS["fast"]
    monkeypatch.setitem(STEPS, "fast", 7)
    assert stage().parameters["iterations"] == 7
    assert stage().key() != before.key()
    monkeypatch.undo()
    assert stage().key() == before.key()


def test_results_depend_on_the_weights_of_the_features(folder: Path) -> None:
    """Other weights: the person is learned, and the sound heard, again."""
    built = pipeline.build(read(folder, with_speech("speech: rnn")))
    stages = [built.identities["host"].stages["finetune"], built.dubs["host_it"].stages["listen"]]
    assert [stage.inputs["speech_weights"] for stage in stages] == [DEFAULT_WEIGHTS] * 2
    mel = (
        pipeline.build(read(folder, with_speech("speech: mel")))
        .identities["host"]
        .stages["finetune"]
    )
    assert "speech_weights" not in mel.inputs


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("speech: whale", "identities.host.speech: .*'mel'"),
        ("speech: hubert", "identities.host.speech: .*need weights of your own"),
        ("speech: hubert, speech_weights: gone", "host.speech_weights: no hubert weights there"),
        ("speech: mel, speech_weights: it.wav", "host.speech_weights: mel features have no"),
        ("speech: rnn, speech_weights: gone.safetensors", "speech_weights: no such file"),
    ],
)
def test_speech_that_cannot_be_heard(folder: Path, keys: str, said: str) -> None:
    (found,) = problems(folder, with_speech(keys))
    assert re.search(said, found)


def test_what_is_no_regular_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (Path("/dev/zero"), tmp_path / "pipe.yaml"):
        with pytest.raises(ManifestError, match="is no regular file"):
            load(path)


def test_a_manifest_of_many_megabytes_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "m.yaml").open("wb") as stream:
        stream.truncate(11 * 10**6)
    with pytest.raises(ManifestError, match="is larger than 10 MB"):
        load(tmp_path / "m.yaml")


def test_a_folder_whose_name_is_no_utf8_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    (folder / "m.yaml").write_text(GOOD)
    with pytest.raises(ManifestError, match="its name is no UTF-8: rename"):
        load(folder / "m.yaml")


@pytest.mark.parametrize("key", ["by", "reference"])
@pytest.mark.parametrize("blank", [" ", "\u200b\u200d", "\\x07", "\u3164", "\u2800"])
def test_blank_consent_is_none(folder: Path, key: str, blank: str) -> None:
    said = {"by": "the person on film", "reference": "form 17"}[key]
    (found,) = problems(folder, GOOD.replace(f'"{said}"', f'"{blank}"'))
    assert found.startswith(f"line 4: identities.host.consent.{key}: must not be empty")


@pytest.mark.parametrize("bottom", ["{x: 1}", "{}"])
def test_merge_keys_cannot_explode(folder: Path, bottom: str) -> None:
    text = f"a0: &a0 {bottom}\n"
    text += "".join(
        f"a{k + 1}: &a{k + 1} {{<<: [{', '.join([f'*a{k}'] * 10)}]}}\n" for k in range(9)
    )
    assert len(text) < 1000
    started = time.perf_counter()
    assert any("too many or too deep aliases" in problem for problem in problems(folder, text))
    assert time.perf_counter() - started < 5


def test_keys_that_are_trees_cannot_explode(folder: Path) -> None:
    text = "a0: &a0 [x, x]\n"
    text += "".join(f"a{k + 1}: &a{k + 1} [*a{k}, *a{k}]\n" for k in range(30))
    assert any("too many" in problem for problem in problems(folder, text + "? *a30\n: x\n"))
    assert "line 1: a key is not text" in problems(folder, "? [x, y]\n: x\n")


def test_a_mapping_that_merges_can_be_used_twice(folder: Path) -> None:
    text = GOOD + "  - &a {identity: host, audio: it.wav, name: a}\n  - &b {<<: *a, name: b}\n"
    manifest = read(folder, text + "  - {<<: [{name: c, label: false}, *b]}\n")
    assert [(d.name, d.label) for d in manifest.dubs[1:]] == [
        ("a", True),
        ("b", True),
        ("c", False),
    ]
    text = "a: &a {x: 1}\nb: &b {<<: *a, x: 2}\nc: *b\n"
    assert yaml_lines.read(text).data == {"a": {"x": 1}, "b": {"x": 2}, "c": {"x": 2}}
    assert yaml_lines.read(text).problems == []


def test_a_manifest_of_too_many_values_is_not_built(folder: Path) -> None:
    assert any("too many values" in p for p in problems(folder, f"a: [{'x, ' * 150_000}]"))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (f"seed: {'1' * 6000}", "line 4: not valid YAML: identities.host.seed '111"),
        (f"seed: 0x{'1' * 6000}", "line 4: not valid YAML: identities.host.seed '0x111"),
        (f"seed: 1{':59' * 6000}", "line 4: not valid YAML: identities.host.seed '1:59"),
        ("seed: 0x" + "1" * 90, "line 4: identities.host.seed: must be less than"),
        ("start: 1.0e+308", "line 4: identities.host.start: must be less than"),
        ("size: [" + "x, " * 5000 + "]", "line 4: identities.host.size: must be"),
        ('base: "\\udcff"', "line 4: not valid YAML: identities.host.base"),
    ],
)
def test_numbers_without_end(folder: Path, keys: str, said: str) -> None:
    text = GOOD.replace("seconds: 2,", f"seconds: 2, {keys},")
    found = problems(folder, text)[0]
    assert found.startswith(said)
    assert len(found) < 200


@pytest.mark.parametrize(
    ("written", "seconds"),
    [
        ("1:05", 65),
        ('"1:05"', 65),
        ("01:05", 65),
        ("0:01", 1),
        ("0:30.5", 30.5),
        ("1:05.25", 65.25),
        ("90:00", 5400),
        ("1:02:03", 3723),
        ("00:00:01.5", 1.5),
        ("65", 65),
    ],
)
def test_a_time_is_read_as_a_clock_shows_it(folder: Path, written: str, seconds: float) -> None:
    keys = ("start", "seconds", "audio_start", "audio_seconds", "video_start")
    text = "\n".join(f"{key}: {written}" for key in keys)
    values = yaml_lines.read(text + "\nclip: host.mp4\nname: a\naudio: it.wav").data
    values |= {"identity": "host", "consent": {"by": "host", "reference": "form"}}
    for model in (Identity, Dub):
        entry = {key: values[key] for key in model.model_fields if key in values}
        found = model.model_validate(entry, context={"folder": folder})
        read_off = [getattr(found, key) for key in keys if key in model.model_fields]
        assert read_off == [seconds] * len(read_off)
        assert len(read_off) > 1


@pytest.mark.parametrize("key", ["start", "seconds"])
@pytest.mark.parametrize("written", ["1:65", "1:5", "01:00:05:12", "-1:05", "1:60:00", "1:05:"])
def test_another_time_is_refused(folder: Path, key: str, written: str) -> None:
    text = GOOD.replace("seconds: 2", f"{key}: {written!r}")
    (said,) = problems(folder, text)
    assert said == (
        f"line 4: identities.host.{key}: must be seconds as 65.5, or a time as 1:05.5 or "
        f"0:01:05.5, not {written!r}"
    )


def test_only_a_time_is_read_in_sixties(folder: Path) -> None:
    (said,) = problems(folder, GOOD.replace("seconds: 2", "seed: 1:05"))
    assert "identities.host.seed: must be a valid integer, not '1:05'" in said


def test_seconds_without_end(folder: Path) -> None:
    (said,) = problems(folder, GOOD.replace("seconds: 2", "seconds: 1.0e+308"))
    assert said.startswith("line 4: identities.host.seconds: must be less than or equal to")


@pytest.mark.parametrize(("length", "fits"), [(58, True), (59, False)])
def test_names_are_counted_in_bytes(folder: Path, length: int, fits: bool) -> None:
    """A file's name has 255 bytes, of which 23 are for what is added to the name."""
    text = GOOD.replace("{identity: host,", f'{{name: "{"😀" * length}", identity: host,')
    if fits:
        manifest = read(folder, text)
        with atomic_path(folder / f"{manifest.dubs[0].name}.sync.json") as temporary:
            temporary.touch()
    else:
        (said,) = problems(folder, text)
        assert "dubs[0].name: must have at most 232 bytes" in said


def test_a_base_whose_header_is_odd_is_no_mistake_of_the_manifest(folder: Path) -> None:
    for header in ("[]", "[" * 9999, '{"format": ["dfrf-1"]}', "3"):
        save_file({"a": np.zeros(1)}, folder / "base.safetensors", {"dfrf": header})
        read(folder, GOOD.replace("seconds: 2,", "seconds: 2, base: base.safetensors,"))


def test_sound_of_more_channels_than_can_be_muxed_is_a_problem(folder: Path) -> None:
    clips.write_sound(folder / "dome.wav", 1, channels=64)
    text = GOOD.replace("audio: it.wav", "audio: dome.wav, codec: CODEC")
    for codec, most in (("h264", 8), ("ffv1", 8)):
        (problem,) = problems(folder, text.replace("CODEC", codec))
        assert re.search(rf"audio: 64 channels in .*dome\.wav: {codec} takes {most} at", problem)
    assert read(folder, text.replace("CODEC", "prores")).dubs


def test_sound_that_is_no_number_fails_its_dub_before_anything_is_made(folder: Path) -> None:
    wave = clips.tone(1.0)
    wave[100] = float("nan")
    soundfile.write(folder / "nan.wav", wave, 16000, subtype="FLOAT")
    manifest = read(folder, GOOD.replace("it.wav", "nan.wav"))
    assert "not finite numbers" in str(manifest.damaged[(folder / "nan.wav").resolve()])
