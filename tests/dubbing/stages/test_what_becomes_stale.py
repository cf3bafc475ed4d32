"""Every key of a manifest, changed one by one: the stages that are made anew, and no others.

Named are those whose own files or parameters change. What reads a stage follows by its result.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from dfrf.checkpoint import read_tensors, write_tensors
from dubbing.batch import jobs
from dubbing.manifest.keys import consent_entry, dub_entry, identity_entry
from dubbing.manifest.keys.edit_entry import Edit
from dubbing.manifest.manifest import load
from dubbing.shipped.base import BASE
from tests import clips
from tests.dubbing.provenance.chain import write_chain
from tests.sequences import write_sequence

pytestmark = pytest.mark.medium

CONSENT = {"by": "Ann", "reference": "form 17", "date": "2026-01-01"}
SRT = "1\n00:00:00,200 --> 00:00:00,600\nANN: Good.\n\n2\n00:00:00,700 --> 00:00:01,000\nBEN: No.\n"
PERSON = {"clip": "ann.mp4", "seconds": 1, "consent": CONSENT}
ALONE = {
    **{"name": "it", "identity": "ann", "audio": "it.wav", "audio_seconds": 0.5, "language": "it"}
}
LABEL = {"credits": {"seconds": 1, "text": "By machine"}}
SIGNED = {**ALONE, "certificate": "signer.pem", "key": "signer.key"}
SCENE = {
    **{"name": "it", "lines": "it.srt", "speakers": {"ANN": "ann"}, "audio": "{cue:02}.wav"},
    **{"music_effects": "me.wav", "mark": False},
}
# Of one speaker, of a scene: where a value lies, what it becomes, and the stages of that change.
OF_CLIP = {"prepare", "check_source", "finetune", "refine_poses", "render", "composite"}
SPOKEN = {"listen", "render", "composite", "check"}
OF_ONE: list[tuple[str, Any, set[str]]] = [
    ("identities.ann.clip", "other.mp4", OF_CLIP),
    ("identities.ann.face", {"at": 0.1, "x": 0.5, "y": 0.5}, {"prepare"}),
    ("identities.ann.start", 0.1, {"finetune"}),
    ("identities.ann.seconds", 0.9, {"finetune"}),
    ("identities.ann.consent.by", "Ann B.", {"composite"}),
    ("identities.ann.consent.date", "2026-01-02", {"composite"}),
    ("identities.ann.consent.reference", "form 18", {"composite"}),
    ("identities.ann.consent.languages", ["it"], {"composite"}),
    ("identities.ann.consent.until", "2099-01-01", {"composite"}),
    ("identities.ann.consent.films", ["ann.mp4"], {"composite"}),
    ("identities.ann.consent.file", "signed.txt", {"composite"}),
    ("identities.ann.consent", "form.yaml", {"composite"}),
    ("identities.ann.preset", "nerf", {"finetune"}),
    ("identities.ann.seed", 1, {"finetune"}),
    ("identities.ann.speech", "mel", {"finetune", "listen"}),
    ("identities.ann.size", 256, {"prepare"}),
    ("identities.ann.finetune.iterations", 5, {"finetune"}),
    ("identities.ann.finetune.learning_rate", 0.001, {"finetune"}),
    ("identities.ann.finetune.rays", 128, {"finetune"}),
    ("identities.ann.finetune.references", 3, {"finetune"}),
    ("dubs.0.name", "other", set()),  # its results are moved
    ("dubs.0.identity", "ben", {"listen", "render", "composite"}),
    ("dubs.0.audio", "other.wav", {"listen", "composite"}),
    ("dubs.0.audio_start", 0.1, {"listen", "composite"}),
    ("dubs.0.audio_seconds", 0.6, SPOKEN),
    ("dubs.0.video_start", 0.04, {"render", "composite"}),
    ("dubs.0.on_longer_audio", "loop", {"render", "composite"}),
    ("dubs.0.render", "marched", {"render"}),
    ("dubs.0.frame", "crop", {"composite"}),
    ("dubs.0.label", {**LABEL, "mark": False}, {"composite"}),
    ("dubs.0.label.credits.seconds", 2, {"composite", "check"}),
    ("dubs.0.label.credits.text", "By us", {"composite"}),
    ("dubs.0.mark", False, {"composite"}),
    ("dubs.0.mark", {"key": "mark.key"}, {"composite"}),
    ("dubs.0.codec", "prores", {"composite", "check"}),
    ("dubs.0.audio_rate", "source", {"composite"}),
    ("dubs.0.edits", {"shift": 80}, {"render"}),
    ("dubs.0.edits.shift", -20.5, {"render"}),
    ("dubs.0.edits.strength", 0, {"render"}),
    ("dubs.0.edits.keys", [{"at": 0.1, "strength": 0}], {"render"}),
    ("dubs.0.edits.curves", "curves.csv", {"render"}),
    ("dubs.0.edits.film_mouth", [{"start": 0.1, "end": 0.4}], {"composite"}),
    ("dubs.0.edits.style", "softer", {"render"}),
    ("dubs.0.edits.moved", [{"start": 0.1, "end": 0.3, "shift": 40}], {"render"}),
    ("dubs.0.edits.takes", {"late": {"shift": 40}}, set()),
    ("dubs.0.edits", {"take": "late", "takes": {"late": {"shift": 40}}}, {"render"}),
    (
        "dubs.0.edits",
        {"take": "new", "takes": {"new": {"audio": "other.wav"}}},
        {"listen", "render", "composite"},
    ),
    ("dubs.0.edits.line", 1, set()),
    ("dubs.0.edits.note", "say it again", set()),
    ("dubs.0.edits.status", "redo", set()),
    ("dubs.0.events", [1, 2], set()),  # of a timeline, which is written when all is made
    ("dubs.0.language", "it-IT", set()),  # compared with what was agreed to, and no more
]
OF_SCENE: list[tuple[str, Any, set[str]]] = [
    ("dubs.0.lines", "later.srt", SPOKEN),
    ("dubs.0.speakers", {"ANN": "ann", "BEN": "ann"}, SPOKEN),
    ("dubs.0.audio", "b{cue:02}.wav", {"listen", "composite"}),
    ("dubs.0.music_effects", "other.wav", {"composite"}),
    ("dubs.0.loudness", "r128", {"composite"}),
    ("dubs.0.edits", {"line": 1, "strength": 0.5}, {"render"}),
    ("dubs.0.edits", {"line": 1, "speaker": "ANN", "note": "softer"}, set()),
]
OF_SIGNED: list[tuple[str, Any, set[str]]] = [
    ("dubs.0.audio", "other.wav", {"listen", "composite", "sign"}),
    ("dubs.0.mark", False, {"composite", "sign"}),
    ("identities.ann.clip", "other.mp4", OF_CLIP | {"sign"}),
    ("identities.ann.consent.reference", "form 18", {"composite", "sign"}),
    ("identities.ann.consent.file", "signed.txt", {"composite", "sign"}),
]
ELSEWHERE = {  # keys that no single value of this file changes
    *("identities.ann.clips", "identities.ann.speech_weights", "identities.ann.base"),
    *("dubs.0.clip", "dubs.0.reel_start", "dubs.0.certificate", "dubs.0.key"),
    *("identities.ann.consent.sha256", "identities.ann.consent.form"),
    *("dubs.0.edits.speaker", "dubs.0.edits.take"),
    *("identities.ann.rate", "identities.ann.colour", "dubs.0.deliver"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All files that the manifests name."""
    place = tmp_path_factory.mktemp("stale")
    clips.write_clip(place / "ann.mp4", 30)
    clips.write_clip(place / "other.mp4", 31)
    for name, hertz in (("it", 220), ("other", 330), ("me", 440), ("01", 220), ("02", 230)):
        seconds = 0.25 if name.isdigit() else 1.0
        clips.write_sound(place / f"{name}.wav", seconds, hertz=hertz)
        clips.write_sound(place / f"b{name}.wav", seconds, hertz=hertz + 5)
    (place / "it.srt").write_text(SRT)
    (place / "later.srt").write_text(SRT.replace("00,200", "00,280"))
    (place / "signed.txt").write_text("I agree.")
    (place / "form.yaml").write_text("by: Ann\nreference: form 17\ndate: 2026-01-01\n")
    (place / "curves.csv").write_text("time,opening\n0.1,0.2\n")
    (place / "mark.key").write_bytes(bytes(range(32)))
    return place


def keys(folder: Path, manifest: dict[str, Any]) -> dict[str, str]:
    """Key of every stage of Ann and of the dub."""
    path = folder / "m.yaml"
    path.write_text(json.dumps(manifest))
    built = jobs.build(load(path))
    found = [job for job in built.all() if job.name != "ben"]
    return {name.name: stage.key() for job in found for name, stage in job.stages.items()}


def manifest_of(dub: dict[str, Any]) -> dict[str, Any]:
    people = {"ann": PERSON, "ben": {**PERSON, "consent": {**CONSENT, "by": "Ben"}}}
    whole = {"version": 1, "output": "out", "identities": people, "dubs": [dub]}
    return copy.deepcopy(whole)


def changed(manifest: dict[str, Any], place: str, value: Any) -> dict[str, Any]:
    """The manifest with another value at a place, whose parents are made."""
    made = copy.deepcopy(manifest)
    *parents, last = place.split(".")
    at: Any = made
    for name in parents:
        at = at[int(name)] if isinstance(at, list) else at.setdefault(name, {})
    at[last] = value
    return made


def stale(folder: Path, before: dict[str, Any], after: dict[str, Any]) -> set[str]:
    old, new = keys(folder, before), keys(folder, after)
    return {name.split()[0] for name in old.keys() | new.keys() if old.get(name) != new.get(name)}


@pytest.mark.parametrize(
    ("place", "value", "expected"), OF_ONE, ids=[f"{p}={v}"[:60] for p, v, _ in OF_ONE]
)
def test_of_a_dub(folder: Path, place: str, value: Any, expected: set[str]) -> None:
    before = manifest_of({**ALONE, "label": LABEL})
    assert stale(folder, before, changed(before, place, value)) == expected


@pytest.mark.parametrize(("place", "value", "expected"), OF_SCENE, ids=[p for p, _, _ in OF_SCENE])
def test_of_a_scene(folder: Path, place: str, value: Any, expected: set[str]) -> None:
    before = manifest_of(SCENE)
    assert stale(folder, before, changed(before, place, value)) == expected


def test_of_an_edit_only_its_own_line(folder: Path) -> None:
    before = changed(manifest_of(SCENE), "dubs.0.speakers", {"ANN": "ann", "BEN": "ann"})
    plain, unset = keys(folder, before), {"line": 1, "shift": 0.0, "strength": 1, "note": "fine"}
    assert keys(folder, changed(before, "dubs.0.edits", [unset])) == plain
    edited = keys(folder, changed(before, "dubs.0.edits", [unset, {"line": 2, "shift": 40}]))
    renders = sorted(name for name in plain if name.startswith("render"))
    assert len(renders) == 2
    assert [name for name in plain if edited[name] != plain[name]] == renders[1:]


@pytest.mark.parametrize(("place", "value", "expected"), OF_SIGNED)
def test_of_a_signed_dub(folder: Path, place: str, value: Any, expected: set[str]) -> None:
    pytest.importorskip("c2pa")
    write_chain(folder)
    before = manifest_of(SIGNED)
    assert stale(folder, before, changed(before, place, value)) == expected


def test_of_another_certificate(folder: Path) -> None:
    pytest.importorskip("c2pa")
    write_chain(folder)
    old = keys(folder, manifest_of(SIGNED))
    write_chain(folder)
    new = keys(folder, manifest_of(SIGNED))
    assert {name for name in new if new[name] != old[name]} == {"sign"}


def test_of_another_base(folder: Path) -> None:
    tensors, header = read_tensors(BASE)
    write_tensors(folder / "base.safetensors", tensors, {**header, "held": ["somebody"]})
    before = manifest_of(ALONE)
    after = changed(before, "identities.ann.base", "base.safetensors")
    assert stale(folder, before, after) == {"finetune"}


def test_of_another_of_the_clips(folder: Path) -> None:
    both = changed(manifest_of(ALONE), "identities.ann.clips", ["ann.mp4", "other.mp4"])
    del both["identities"]["ann"]["clip"]
    first, second = (changed(both, "dubs.0.clip", film) for film in ("ann.mp4", "other.mp4"))
    of_film = {"prepare", "check_source", "refine_poses", "render", "composite"}
    assert stale(folder, first, second) == of_film


def test_of_an_image_sequence(folder: Path) -> None:
    write_sequence(folder / "shot.####.exr", [np.zeros((64, 64, 3), np.float16)] * 30)
    before = changed(manifest_of(ALONE), "identities.ann.clips", ["ann.mp4", "shot.####.exr"])
    del before["identities"]["ann"]["clip"]
    before["identities"]["ann"]["rate"] = 25
    before["dubs"][0]["clip"] = "shot.####.exr"
    again = {"prepare", "check_source", "refine_poses", "render", "composite"}
    for place, value, expected in (
        ("identities.ann.rate", 24, again | {"listen", "check"}),
        ("identities.ann.colour", {"film": "ACEScg"}, again),
        ("identities.ann.colour", {"film": "ACEScg", "clips": ["shot.####.exr"]}, again),
        ("dubs.0.deliver", "turnover", {"composite"}),
    ):
        assert stale(folder, before, changed(before, place, value)) == expected, place


def fields(kind: type[BaseModel], place: str) -> Iterator[str]:
    """Places of the keys of an entry, those of the entries in it too."""
    inner: dict[str, type[BaseModel]] = {
        **{"consent": consent_entry.Consent, "finetune": identity_entry.Finetune},
        **{"label": dub_entry.Label, "credits": dub_entry.Credits, "edits": Edit},
    }
    for name in kind.model_fields:
        yield f"{place}.{name}"
        if name in inner:
            yield from fields(inner[name], f"{place}.{name}")


def test_no_key_is_forgotten_here() -> None:
    tried = {place for place, *_ in (*OF_ONE, *OF_SCENE)} | ELSEWHERE
    tried |= {"dubs.0.label.mark", "dubs.0.label.credits", "identities.ann.finetune"}
    known = {*fields(identity_entry.Identity, "identities.ann"), *fields(dub_entry.Dub, "dubs.0")}
    assert known == tried
