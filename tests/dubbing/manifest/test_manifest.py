from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import soundfile
from safetensors.numpy import save_file

from dubbing.batch import jobs
from dubbing.engine.disk.files import atomic_path
from dubbing.engine.graph.stage import Stage
from dubbing.errors import ManifestError
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.manifest.manifest import load
from dubbing.provenance.card import CreditsCard
from dubbing.stages.finetune import Finetune
from tests import clips
from tests.dubbing.manifest.made import GOOD, problems, read


def test_a_good_manifest(folder: Path) -> None:
    manifest = read(folder, GOOD)
    host, (dub,) = manifest.people["host"], manifest.dubs.values()
    assert manifest.output == (folder / "out").resolve()
    assert host.clip.path == (folder / "host.mp4").resolve()
    assert (host.settings, host.start) == (FinetuneSettings(), 0)
    assert dub.name == "host_it"
    assert (dub.on_longer_audio, dub.settings.frame, dub.settings.label, dub.settings.codec) == (
        "bounce",
        "full",
        True,
        "h264",
    )
    assert host.clip.frames == dub.film.frames == 75


def test_defaults_reach_identities_and_dubs_and_can_be_overruled(folder: Path) -> None:
    manifest = read(
        folder,
        f"""
        version: 1
        output: out
        defaults: {{preset: nerf, seed: 7, label: false, finetune: {{iterations: 9}}, start: 0.5}}
        identities:
          a: {{clip: host.mp4, consent: {clips.CONSENT}, seconds: 1}}
          b:
            {{clip: host.mp4, consent: {clips.CONSENT}, seconds: 1, seed: 8,
            finetune: {{iterations: 5}}}}
        dubs:
          - {{identity: a, audio: it.wav}}
          - {{identity: b, audio: it.wav, label: true, name: other}}
        """,
    )
    a, b = manifest.people["a"], manifest.people["b"]
    assert a.start == 0.5
    assert a.settings == FinetuneSettings(preset="nerf", seed=7, iterations=9)
    assert b.settings == FinetuneSettings(preset="nerf", seed=8, iterations=5)
    assert [dub.settings.label for dub in manifest.dubs.values()] == [False, True]


@pytest.mark.parametrize(
    ("keys", "marked"),
    [
        ("codec: h264", True),
        ("codec: prores4444", True),
        ("codec: ffv1", False),
        ("codec: ffv1, label: true", True),
        ("codec: ffv1, label: {credits: {}}", False),
        ("codec: hevc, label: false", False),
    ],
)
def test_a_master_has_no_visible_mark_unless_it_is_asked_for(
    folder: Path, keys: str, marked: bool
) -> None:
    text = f"""
        version: 1
        output: out
        identities:
          a: {{clip: host.mp4, consent: {clips.CONSENT}, seconds: 1}}
        dubs:
          - {{identity: a, audio: it.wav, name: it, {keys}}}
        """
    assert read(folder, text).dubs["it"].settings.label is marked


def test_everything_wrong_is_reported_at_once_with_key_and_line(folder: Path) -> None:
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
          mute: {clip: silent.mp4, consent: {by: a, reference: b, languages: it}}
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
        "line 12: identities.mute.consent.languages: must be a list, not text",
        "line 14: dubs[0].audio: no sound in",
        "line 15: dubs[1].audio: must be the path of a file",
        "line 15: dubs[1].identity: no identity 'nobody'; there is host, ../evil, mute",
        "line 15: dubs[1].name: would leave the output folder",
        "line 16: dubs[2].audio_start: 70 s is past the end: the sound is 2.0 s long",
        "line 16: dubs[2].frame: must be one of 'full' or 'crop', not 'half'",
        "line 17: dubs[3].label: must be true, false or {mark, credits}, not 'no'",
        "line 17: dubs[3].name: the name 'A' is taken by dubs[2].name (line 16)",
        "line 17: dubs[3].video_start: 9 s is past the end: the last frame of the clip is at 2.96",
        "line 18: dubs[4]: must hold keys, not text",
    ]
    assert len(found) == len(expected), "\n".join(found)
    for message, wanted in zip(found, expected, strict=True):
        assert message.startswith(wanted)


def test_a_card_of_credits(folder: Path) -> None:
    label = "label: {mark: false, credits: {seconds: 0:02, text: Thanks}}"
    (dub,) = read(folder, GOOD.replace("audio:", f"{label}, audio:")).dubs.values()
    assert not dub.settings.label
    assert dub.settings.card == CreditsCard("Thanks", 50)
    wrong = {
        "{credits: {seconds: 0}}": ".credits.seconds: must be greater than 0, not 0",
        "{credits: {seconds: 90}}": ".credits.seconds: must be less than or equal to 60, not 90",
        '{credits: {text: " "}}': ".credits.text: must not be empty",
        "{credits: {txt: a}}": ".credits.txt: unknown key",
        "{credits: 3}": ".credits: must hold keys, not 3",
        "{mark: 3}": ".mark: must be true or false, not 3",
        "{credits: {text: \u65e5\u672c a}}": ".credits.text: the card has no letters for",
    }
    for value, message in wrong.items():
        (found,) = problems(folder, GOOD.replace("audio:", f"label: {value}, audio:"))
        assert found.startswith(f"line 6: dubs[0].label{message}")


def test_consent_is_required(folder: Path) -> None:
    text = GOOD.replace(f", consent: {clips.CONSENT}", "")
    assert problems(folder, text) == ["line 4: identities.host.consent: is required"]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("~no_such_user/x.mp4", "Could not determine home directory"),
        ("x" * 300, "File name too long"),
        ("a\\0b", "embedded null"),
    ],
)
def test_what_cannot_be_a_path(folder: Path, path: str, message: str) -> None:
    text = GOOD.replace("host.mp4", f'"{path}"')
    found = problems(folder, text)
    assert len(found) == 1
    assert found[0].startswith("line 4: identities.host.clip: cannot be a path: ")
    assert message in found[0]


@pytest.mark.parametrize("name", ["..", ".hidden", "a/b", "a\\\\b", "", " x", "C:x", "x" * 101])
def test_names_stay_in_the_output_folder(folder: Path, name: str) -> None:
    text = GOOD.replace("{identity: host,", f'{{name: "{name}", identity: host,')
    assert all("dubs[0].name" in problem for problem in problems(folder, text))


def test_two_dubs_need_two_names(folder: Path) -> None:
    text = GOOD + "  - {identity: host, audio: it.wav, audio_start: 1}\n"
    (message,) = problems(folder, text)
    assert message.startswith("line 7: dubs[1].name: the name 'host_it' is taken by dubs[0].name")


def test_a_missing_manifest(tmp_path: Path) -> None:
    with pytest.raises(ManifestError, match="no such file"):
        load(tmp_path / "none.yaml")


def test_a_damaged_file_is_no_mistake_of_the_manifest(folder: Path) -> None:
    manifest = read(folder, GOOD.replace("host.mp4", "damaged.mp4"))
    damaged = manifest.people["host"].clip.damaged
    assert damaged is not None
    assert damaged.where == str((folder / "damaged.mp4").resolve())


def test_date_of_consent(folder: Path) -> None:
    text = GOOD.replace('"form 17"', '"form 17", date: 2026-11-02')
    assert str(read(folder, text).people["host"].consent.terms["date"]) == "2026-11-02"
    (message,) = problems(folder, text.replace("2026-11-02", "yesterday"))
    assert message.startswith("line 4: identities.host.consent.date")
    (message,) = problems(folder, text.replace("2026-11-02", "2026-13-45"))
    assert message.startswith("line 4: not valid YAML: identities.host.consent.date '2026-13-45'")


def test_a_changed_number_of_steps_is_seen(folder: Path) -> None:
    def stage(more: str = "") -> Stage:
        text = GOOD.replace("consent:", f"{more}consent:", 1)
        return jobs.build(read(folder, text)).by_label["identity/host"].stage(Finetune)

    few, many = (stage(f"finetune: {{iterations: {n}}}, ") for n in (7, 2000))
    assert few.parameters["settings"]["iterations"] == 7
    assert len({few.key(), many.key(), stage().key()}) == 3
    assert few.amount() < stage().amount() < many.amount()


def test_what_a_researcher_changes_of_a_fine_tune(folder: Path) -> None:
    text = GOOD.replace("consent:", "finetune: {rays: 640, learning_rate: 1.0e-3}, consent:", 1)
    changed, plain = (
        jobs.build(read(folder, one)).by_label["identity/host"].stage(Finetune)
        for one in (text, GOOD)
    )
    assert changed.parameters["settings"]["rays"] == 640
    assert changed.parameters["settings"]["learning_rate"] == 1e-3
    assert plain.parameters["settings"]["rays"] is None
    assert changed.key() != plain.key()


def test_references_are_counted_in_fast_alone(folder: Path) -> None:
    keys = "finetune: {references: 2}, preset: nerf, consent:"
    found = problems(folder, GOOD.replace("consent:", keys, 1))
    assert len(found) == 1
    assert "finetune.references: preset 'nerf' has a fixed number of them" in found[0]


@pytest.mark.parametrize("key", ["by", "reference"])
@pytest.mark.parametrize("blank", [" ", "\u200b\u200d", "\\x07", "\u3164", "\u2800"])
def test_blank_consent_is_none(folder: Path, key: str, blank: str) -> None:
    message = {"by": "the person on film", "reference": "form 17"}[key]
    (found,) = problems(folder, GOOD.replace(f'"{message}"', f'"{blank}"'))
    assert found.startswith(f"line 4: identities.host.consent.{key}: must not be empty")


@pytest.mark.parametrize(("length", "fits"), [(57, True), (58, False)])
def test_names_are_counted_in_bytes(folder: Path, length: int, fits: bool) -> None:
    """A file's name has 255 bytes, of which 23 are for what is added to the name."""
    text = GOOD.replace("{identity: host,", f'{{name: "{"😀" * length}", identity: host,')
    if fits:
        manifest = read(folder, text)
        with atomic_path(folder / f"{next(iter(manifest.dubs))}.sync.json") as temporary:
            temporary.touch()
    else:
        (message,) = problems(folder, text)
        assert "dubs[0].name: must have at most 230 bytes" in message


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
    assert "not finite numbers" in str(manifest.dubs["host_nan"].blocked)
