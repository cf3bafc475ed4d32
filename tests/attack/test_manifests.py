"""Manifests and consent forms that are wrong in every way that one can write down."""

from __future__ import annotations

import json
import os
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.attack import rule
from tests.attack.conftest import Room
from tests.attack.odd import cases, damaged, names, spoilt

pytestmark = pytest.mark.medium


WHOLE: dict[str, Any] = {
    "version": 1,
    "output": "out",
    "defaults": {"preset": "fast", "seed": 0, "mark": True},
    "identities": {
        "ann": {
            "clip": "ann.mp4",
            "start": 0.0,
            "seconds": 1,
            "consent": {"by": "Ann", "date": "2026-11-02", "reference": "form 17"},
            "finetune": {"iterations": 5},
            "size": 64,
            "speech": "rnn",
        }
    },
    "dubs": [
        {
            "name": "it",
            "identity": "ann",
            "audio": "it.wav",
            "audio_start": "0:00.1",
            "audio_seconds": 1,
            "video_start": 0,
            "on_longer_audio": "bounce",
            "render": "baked",
            "frame": "full",
            "codec": "h264",
            "audio_rate": 48000,
            "edits": [{"line": 1, "shift": -20, "strength": 0.5, "note": "softer"}],
            "label": True,
        }
    ],
}
FORM = b"by: Ann\ndate: 2026-11-02\nreference: form 17\nlanguages: [it]\nuntil: 2999-01-01\n"
TEXT = b"""version: 1
output: out
defaults: &all {preset: fast}
identities:
  ann: {<<: *all, clip: ann.mp4, seconds: 1, consent: {by: Ann, reference: form 17}}
dubs:
  - {name: it, identity: ann, audio: it.wav}
"""
TEXTS = (
    b"",
    b"\0" * 100,
    b"\xff\xfe" + TEXT.decode().encode("utf-16-le"),
    b"\xef\xbb\xbf" + TEXT,
    TEXT.replace(b"1", b"!!python/object/apply:os.system ['touch pwned']"),
    TEXT.replace(b"it.wav", b"!!binary aGk="),
    b"[" * 5000,
    b"{a: " * 3000,
    b"- " * 4000 + b"a",
    b"a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n" * 30,
    b"&a [*a]",
    b"a: &a {<<: *a}",
    b"&a " * 500,
    b"? " * 2000,
    b"'" + b"a" * 100_000,
    b"x: |" + b"\n y" * 50_000,
    b"%YAML 9.9\n---\na",
    TEXT + b"---\n" + TEXT,
    TEXT + TEXT,
    b"".join(b"k%d: 1\n" % k for k in range(5000)),
    b"version: " + b"9" * 6000,
    b"version: 0x" + b"f" * 6000,
    b"version: 1_0:59:59:59:59",
    b"version: 2026-99-99",
    b"version: .inf",
    b"*unknown",
    b"version: !!set {a, b}\noutput: !!omap [a: 1]",
)


def written(data: Any) -> bytes:
    return json.dumps(data, ensure_ascii=False).encode(errors="surrogatepass")


@given(spoilt(WHOLE))
@cases(80)
def test_values_that_do_not_belong_there(room: Room, data: Any) -> None:
    with room() as folder:
        (folder / "m.yaml").write_bytes(written(data))
        rule.judge("manifest: values", folder, "plan", "m.yaml", reads_only=True)


@given(names)
@cases(8)
@pytest.mark.parametrize(
    "place",
    [
        ("output",),
        ("identities", "ann", "clip"),
        ("identities", "ann", "base"),
        ("identities", "ann", "consent"),
        ("dubs", 0, "audio"),
        ("dubs", 0, "name"),
        ("dubs", 0, "certificate"),
    ],
)
def test_names_and_paths(room: Room, place: tuple[Any, ...], name: str) -> None:
    data = json.loads(json.dumps(WHOLE))
    inside = data
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = name
    with room() as folder:
        (folder / "m.yaml").write_bytes(written(data))
        rule.judge("manifest: names and paths", folder, "plan", "m.yaml", reads_only=True)


@pytest.mark.parametrize("text", TEXTS, ids=range(len(TEXTS)))
def test_texts_that_ask_for_too_much(room: Room, text: bytes) -> None:
    with room() as folder:
        (folder / "m.yaml").write_bytes(text)
        rule.judge("manifest: text", folder, "plan", "m.yaml", reads_only=True)


@given(st.sampled_from(TEXTS + (TEXT,) * 30).flatmap(lambda text: damaged(text[:2000])))
@cases(40)
def test_damaged_text(room: Room, text: bytes) -> None:
    with room() as folder:
        (folder / "m.yaml").write_bytes(text)
        rule.judge("manifest: text", folder, "plan", "m.yaml", reads_only=True)


@given(damaged(FORM))
@cases(15)
def test_consent_forms(room: Room, form: bytes) -> None:
    with room() as folder:
        (folder / "m.yaml").write_text(TEXT.decode().replace("{by: Ann, reference: form 17}", "f"))
        (folder / "f").write_bytes(form)
        rule.judge("manifest: consent form", folder, "plan", "m.yaml", reads_only=True)


def test_a_manifest_that_holds_is_planned(room: Room) -> None:
    """So that the cases above are refused for what was done to them."""
    for whole in (written(WHOLE), TEXT):
        with room() as folder:
            (folder / "m.yaml").write_bytes(whole)
            ending = rule.call("plan", "m.yaml")
            assert ending.code == 0, ending.err


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/null", ".", "missing", "\udcff", "fifo"])
def test_what_is_no_file(room: Room, path: str) -> None:
    with room() as folder:
        os.mkfifo(folder / "fifo")
        for command in ("plan", "dub", "evaluate"):
            rule.judge("manifest: no file", folder, command, path, reads_only=True)
