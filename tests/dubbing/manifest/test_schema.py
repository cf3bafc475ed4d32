"""The schema of a manifest: as shipped, for every manifest that loads, and against mistakes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from urllib.parse import unquote, urlparse

import pytest
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.manifest import schema
from dubbing.manifest.init import write_manifest
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.identity_entry import Identity
from tests import clips
from tests.dubbing.manifest.json_schema import errors

ROOT = Path(__file__).resolve().parents[3]
SCHEMA = schema.build()
# Every way to write a value that has several.
ALL = """
version: 1
output: out
defaults: {preset: fast, seed: 0, label: false, audio_seconds: 0:02, finetune: {rays: 99}}
identities:
  "Ann Smith":
    clip: ann.mp4
    face: {at: 1:05.5, x: 0.5, y: 0}
    start: 65
    seconds: best
    consent: form.yaml
  bob:
    clips: [bob.mp4, other.mp4]
    face: [{at: 2, x: 1, y: .5}, {at: 0:01:05, x: 0.1, y: 0.1}]
    seconds: 0:20
    consent:
      by: "Bob"
      reference: "17"
      date: 2026-11-02
      until: 2027-11-02
      languages: [it, pt-BR]
      films: [bob.mp4]
    finetune: {iterations: 5, learning_rate: 1.0e-3, references: 4}
dubs:
  - {identity: bob, audio: it.wav, clip: null, label: {credits: {seconds: 0:03, text: "By AI"}}}
  - name: "Szene 1"
    lines: it.srt
    speakers: {BOB: bob, ANN: "Ann Smith"}
    audio: {BOB: bob.wav, ANN: "ann_{cue:03}.wav"}
    reel_start: 01:00:00:00
    mark: {key: studio.key}
    audio_rate: source
    edits: [{line: 3, shift: -40.5}, {line: 7, speaker: BOB, strength: 1.5, note: "louder"}]
  - {identity: bob, audio: it.wav, reel_start: 3600.5, mark: false, label: {mark: false}}
  - {identity: bob, audio: it.wav, edits: {shift: 80, status: redo}}
"""


def wrong(text: str) -> list[str]:
    """What the schema has against a manifest."""
    return list(errors(SCHEMA, yaml_lines.read(text).data))


def test_the_shipped_schema_is_that_of_the_models() -> None:
    shipped = (ROOT / "dubbing/manifest" / schema.FILE).read_text(encoding="utf-8")
    result = CliRunner().invoke(app, ["schema"])
    assert (result.exit_code, result.output) == (0, schema.text())
    assert shipped == schema.text(), "run `make docs`"


@pytest.mark.parametrize("path", sorted((ROOT / "manifests").glob("*.yaml")), ids=lambda p: p.stem)
def test_the_manifests_that_ship_are_valid(path: Path) -> None:
    assert not wrong(path.read_text(encoding="utf-8"))


def test_every_way_to_write_a_value_is_valid() -> None:
    assert not wrong(ALL)


@pytest.mark.parametrize(
    ("written", "instead", "place"),
    [
        ("version: 1", "version: 2", "version: const"),
        ("output: out", "outputs: out", "outputs: not allowed"),
        ("preset: fast", "preset: quick", "defaults.preset: enum"),
        ("clip: ann.mp4", 'clip: ""', "identities.Ann Smith.clip: pattern"),
        ("clip: ann.mp4", "clips: []", "identities.Ann Smith.clips: minItems"),
        ("clip: ann.mp4", "size: 512", "identities.Ann Smith: anyOf"),
        ("start: 65", "start: -1", "identities.Ann Smith.start: anyOf"),
        ("start: 65", "start: 1:65", "identities.Ann Smith.start: anyOf"),
        ("start: 65", "size: 100", "identities.Ann Smith.size: multipleOf"),
        ("seconds: best", "seconds: worst", "identities.Ann Smith.seconds: anyOf"),
        ("consent: form.yaml", "", "identities.Ann Smith: required"),
        ('reference: "17"', "", "identities.bob.consent: required"),
        ("languages: [it, pt-BR]", "form: form.yaml", "identities.bob.consent: anyOf"),
        ("rays: 99", "ray: 99", "defaults.finetune.ray: not allowed"),
        ("audio: it.wav, clip", "clip", "dubs[0]: required"),
        ("shift: 80", "shift: 501", "dubs[3].edits: anyOf"),
        ('name: "Szene 1"', "name: a/b", "dubs[1].name: pattern"),
        ("mark: {key: studio.key}", "mark: studio.key", "dubs[1].mark: anyOf"),
        ('"Ann Smith":', '"/ann":', "identities./ann: pattern"),
    ],
)
def test_a_mistake_is_found(written: str, instead: str, place: str) -> None:
    assert ALL.count(written) >= 1
    assert place in wrong(ALL.replace(written, instead, 1))


def test_what_defaults_give_is_not_missed() -> None:
    without = "version: 1\noutput: o\nidentities: {ann: {clip: a.mp4}}\ndubs: [{}]\n"
    assert wrong(without) == ["identities.ann: required", "dubs[0]: required"]
    assert not wrong(without + f"defaults: {{consent: {clips.CONSENT}, audio: it.wav}}\n")


def test_every_key_is_described_in_the_schema() -> None:
    parts = SCHEMA["$defs"]
    models = Entry.__subclasses__()
    models += [one for model in models for one in model.__subclasses__()]
    assert set(parts) == {model.__name__ for model in models}
    for model in models:
        keys = parts[model.__name__]["properties"]
        assert set(keys) == set(model.model_fields) - {"form"}
        assert all(key.get("description", "").endswith(".") for key in keys.values())
    assert set(SCHEMA["properties"]["defaults"]["properties"]) == {
        *Identity.model_fields,
        *Dub.model_fields,
    }
    assert all("description" in key for key in SCHEMA["properties"].values())


def test_init_names_the_shipped_schema_for_editors(tmp_path: Path) -> None:
    clips.write_clip(tmp_path / "host.mp4", 30)
    clips.write_sound(tmp_path / "host_it.wav", 1)
    first = write_manifest(tmp_path).read_text().splitlines()[0]
    uri = re.fullmatch(r"# yaml-language-server: \$schema=(file://\S+)", first)
    assert uri is not None
    assert json.loads(Path(unquote(urlparse(uri[1]).path)).read_text()) == SCHEMA
