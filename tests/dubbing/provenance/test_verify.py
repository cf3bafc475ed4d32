"""`dfrf verify`: what is in a file, by sentence, by JSON and by exit code."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from dubbing import media
from dubbing.cli.main import app
from dubbing.errors import MediaError
from dubbing.provenance import credentials, mark_key, mark_search
from dubbing.provenance.mark_key import read_key
from dubbing.provenance.provenance import tags
from tests import clips
from tests.dubbing.provenance import film
from tests.dubbing.provenance.chain import write_chain

pytestmark = pytest.mark.medium


@pytest.fixture(autouse=True)
def _few_scales(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search at every scale, which takes seconds, has tests of its own (`test_mark_search`)."""
    few = mark_search.candidates()[:3]
    monkeypatch.setattr(mark_search, "candidates", lambda: few)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``dub.mp4``, marked and tagged, the film it was made of, and the key."""
    folder = tmp_path_factory.mktemp("verify")
    (folder / "own.key").write_bytes(b"a secret that nobody knows")
    key = read_key(folder / "own.key")
    plain = film.frames(75)
    silent = film.write(folder / "silent.mp4", film.marked(plain, key))
    sound = clips.write_sound(folder / "sound.wav", 3)
    media.mux(silent, sound, folder / "dub.mp4", audio_start=0, seconds=3, metadata=tags())
    film.write(folder / "film.mp4", plain)
    return folder


def verify(file: Path, *options: str | Path) -> Result:
    return CliRunner().invoke(app, ["verify", str(file), *map(str, options)])


def test_verify_prints_what_a_dub_carries(place: Path) -> None:
    result = verify(place / "dub.mp4", "--key", place / "own.key")
    assert result.exit_code == 0, result.output
    assert "credentials: none" in result.output
    assert f"invisible mark: {film.ID}" in result.output
    assert "AI-generated picture" in result.output


def test_credentials_and_mark_as_json(place: Path) -> None:
    pytest.importorskip("c2pa")
    signed = place / "signed.mp4"
    facts = {"consent": {"reference": "form 17"}}
    credentials.sign(place / "dub.mp4", signed, write_chain(place), place / "film.mp4", facts)
    result = verify(signed, "--key", place / "own.key", "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["credentials"]["state"] == "Valid"
    assert found["credentials"]["dub"] == facts
    assert [m["id"] for m in found["marks"] if m["present"]] == [film.ID]
    assert "c2pa.dubbed" in verify(signed).output


def test_a_mark_alone_is_enough(place: Path) -> None:
    stripped = film.treated(place / "dub.mp4", "-map_metadata", "-1", "-an", "-c", "copy")
    assert verify(stripped, "--key", place / "own.key").exit_code == 0


def test_words_of_ai_in_the_metadata_are_nothing(place: Path) -> None:
    words = "comment=Shot on film. Nothing here is AI-generated."
    file = film.treated(place / "film.mp4", "-c", "copy", "-metadata", words)
    assert verify(file).exit_code == 1


@pytest.mark.parametrize("where", ["mdat", "c2pa.signature"])
def test_credentials_that_do_not_hold_are_exit_code_1_whatever_lies_beside(
    place: Path, where: str
) -> None:
    pytest.importorskip("c2pa")
    signed = place / f"{where}.mp4"
    credentials.sign(place / "dub.mp4", signed, write_chain(place), place / "film.mp4", {})
    content = bytearray(signed.read_bytes())
    at = content.index(where.encode()) + 100
    content[at : at + 60] = bytes(byte ^ 1 for byte in content[at : at + 60])
    signed.write_bytes(content)
    result = verify(signed, "--key", place / "own.key")
    assert result.exit_code == 1, result.output
    assert "do not hold: the file was changed after it was signed" in " ".join(
        result.output.split()
    )
    found = json.loads(verify(signed, "--key", place / "own.key", "--json").output)
    assert (found["found"], found["credentials_broken"]) == (False, True)
    assert found["metadata"]


def test_nothing_found_is_exit_code_1(place: Path) -> None:
    result = verify(place / "film.mp4", "--key", place / "own.key", "--json")
    assert result.exit_code == 1, result.output
    found = json.loads(result.output)
    assert not found["found"]
    assert not any(mark["present"] for mark in found["marks"])
    assert found["metadata"] == {}


def test_without_a_key_the_mark_is_not_looked_for(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mark_key, "installation_file", lambda: tmp_path / "none.key")
    assert "there is no key here" in verify(place / "film.mp4").output


def test_a_wrong_call_is_exit_code_2(place: Path) -> None:
    for call in (["gone.mp4"], [place], []):
        assert CliRunner().invoke(app, ["verify", *map(str, call)]).exit_code == 2


@pytest.mark.parametrize("content", [b"", b"no video", b"\0" * 3000])
def test_what_is_no_video_is_reported(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "x.mp4"
    file.write_bytes(content)
    error = verify(file).exception
    assert isinstance(error, MediaError)
    assert str(file) in str(error)
