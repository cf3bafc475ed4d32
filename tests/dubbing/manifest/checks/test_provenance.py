"""What a manifest says of marks, credentials and consent."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from dubbing import packages
from dubbing.errors import ManifestError
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from dubbing.provenance import credentials
from dubbing.provenance.signer import Signer
from tests import clips
from tests.dubbing.provenance.chain import write_chain

CONSENT = '{by: "the person on film", reference: "form 17"}'


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("provenance")
    clips.write_clip(place / "host.mp4", 75)
    clips.write_sound(place / "it.wav", 2)
    return place


def read(folder: Path, dub: str = "", consent: str = CONSENT) -> Production:
    path = folder / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        f"  host: {{clip: host.mp4, seconds: 2, consent: {consent}}}\n"
        f"dubs:\n  - {{identity: host, audio: it.wav, {dub}}}\n"
    )
    return load(path)


def problems(folder: Path, dub: str = "", consent: str = CONSENT) -> list[str]:
    with pytest.raises(ManifestError) as caught:
        read(folder, dub, consent)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("maybe", "must be true, false or {key: FILE}"),
        ("{colour: red}", "unknown key"),
        ("{key: gone.key}", "the mark's key cannot be read"),
        ("{key: short.key}", "it needs 16 at least"),
    ],
)
def test_a_mark_that_cannot_be_drawn(footage: Path, written: str, message: str) -> None:
    (footage / "short.key").write_bytes(b"abc")
    (found,) = problems(footage, f"mark: {written}")
    assert "dubs[0].mark" in found
    assert message in found


def test_the_mark_is_on_unless_it_is_turned_off(footage: Path) -> None:
    key = footage / "own.key"
    key.write_bytes(bytes(range(32)))
    for written, file in (("", None), ("mark: true", None), ("mark: {key: own.key}", key)):
        (dub,) = read(footage, written).dubs.values()
        assert dub.marked
        assert dub.mark_key == file
    (dub,) = read(footage, "mark: false").dubs.values()
    assert dub.marking() is None


def test_credentials_that_cannot_be_signed(footage: Path) -> None:
    pytest.importorskip("c2pa")
    write_chain(footage)
    signed = "certificate: signer.pem, key: signer.key"
    (dub,) = read(footage, signed).dubs.values()
    assert dub.signer == Signer(footage / "signer.pem", footage / "signer.key")
    for written, message in (
        ("certificate: signer.pem", "needs both"),
        (f"{signed}, codec: ffv1", ".mkv cannot carry credentials"),
        ("certificate: signer.pem, key: signer.pem", "is no private key in PEM"),
        ("certificate: gone.pem, key: signer.key", "No such file"),
    ):
        (found,) = problems(footage, written)
        assert message in found


def test_credentials_without_the_library_name_what_to_install(
    footage: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "c2pa", None)
    write_chain(footage)
    (found,) = problems(footage, "certificate: signer.pem, key: signer.key")
    assert "not installed: c2pa" in found
    assert packages.command(["c2pa"]) in found


def test_what_becomes_of_broken_credentials_of_the_film_is_said(
    footage: Path, tmp_path: Path
) -> None:
    pytest.importorskip("c2pa")
    clips.write_sound(tmp_path / "it.wav", 2)
    whole = tmp_path / "host.mp4"
    signer = write_chain(tmp_path)
    credentials.sign(footage / "host.mp4", whole, signer, footage / "host.mp4", {})
    keys = "certificate: signer.pem, key: signer.key"
    assert not any("credentials" in warning for warning in read(tmp_path, keys).warnings)
    content = bytearray(whole.read_bytes())
    content[content.index(b"mdat") + 100] ^= 1
    whole.write_bytes(content)
    (warning,) = (w for w in read(tmp_path, keys).warnings if "credentials" in w)
    assert "signed over host.mp4, though its credentials do not hold" in warning
    assert not any("credentials" in warning for warning in read(tmp_path).warnings)
    start = content.index(b"jumb") + 60
    content[start : start + 140] = bytes(140)
    whole.write_bytes(content)
    assert any("cannot be signed over" in problem for problem in problems(tmp_path, keys))


def test_a_user_without_a_home_is_told_of_the_key(
    footage: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_CONFIG_HOME")
    monkeypatch.setenv("HOME", "")
    assert sum("mark: {key: FILE}" in warning for warning in read(footage).warnings) == 1
    assert not any("mark:" in warning for warning in read(footage, "mark: false").warnings)
