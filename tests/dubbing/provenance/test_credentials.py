"""Credentials are signed, read back by the library's own reader, and bound to the bytes."""

import shutil
from pathlib import Path

import pytest

from dubbing.errors import StageError
from dubbing.provenance import credentials
from dubbing.provenance.signer import Signer
from tests import clips
from tests.dubbing.provenance.chain import write_chain

pytest.importorskip("c2pa")
SAID = {"consent": {"reference": "form 17"}, "model": "abc", "audio": "def"}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("signing")
    for name in ("dub.mp4", "dub.mov", "film.mp4"):
        clips.write_clip(folder / name, 10)
    shutil.copyfile(folder / "film.mp4", folder / "film.mkv")
    return folder


@pytest.fixture(scope="module")
def signer(place: Path) -> Signer:
    return write_chain(place)


@pytest.mark.parametrize(("dub", "film"), [("dub.mp4", "film.mp4"), ("dub.mov", "film.mkv")])
def test_what_was_signed_is_read_back(place: Path, signer: Signer, dub: str, film: str) -> None:
    out = place / f"signed_{dub}"
    credentials.sign(place / dub, out, signer, place / film, SAID)
    found = credentials.read(out)
    assert found is not None
    assert found.state == "Valid"
    assert found.actions == ["c2pa.opened", "c2pa.dubbed"]
    assert found.dub == SAID
    assert found.signed_by == "signer, Test House"
    assert found.earlier == 0
    assert credentials.read(place / dub) is None


def test_credentials_of_the_film_are_kept(place: Path, signer: Signer) -> None:
    film = place / "credited.mp4"
    credentials.sign(place / "film.mp4", film, write_chain(place, "studio"), place / "film.mp4", {})
    out = place / "signed_twice.mp4"
    credentials.sign(place / "dub.mp4", out, signer, film, SAID)
    found = credentials.read(out)
    assert found is not None
    assert (found.state, found.earlier) == ("Valid", 1)


def test_a_changed_picture_is_noticed(place: Path, signer: Signer) -> None:
    out = place / "signed_changed.mp4"
    credentials.sign(place / "dub.mp4", out, signer, place / "film.mp4", SAID)
    content = bytearray(out.read_bytes())
    content[content.index(b"mdat") + 100] ^= 1
    out.write_bytes(content)
    found = credentials.read(out)
    assert found is not None
    assert found.state == "Invalid"
    assert any("hash" in problem for problem in found.problems)


def test_a_film_whose_credentials_do_not_hold_is_said_to_be_so(place: Path, signer: Signer) -> None:
    credited, film = place / "whole.mp4", place / "broken.mp4"
    studio = write_chain(place, "studio")
    credentials.sign(place / "film.mp4", credited, studio, place / "film.mp4", {})
    assert credentials.film_problem(credited) == ("", False)
    content = bytearray(credited.read_bytes())
    content[content.index(b"mdat") + 100] ^= 1
    film.write_bytes(content)
    problem, prevents = credentials.film_problem(film)
    assert "its credentials do not hold: " in problem
    assert not prevents
    out = place / "signed_over.mp4"
    credentials.sign(place / "dub.mp4", out, signer, film, SAID)
    found = credentials.read(out)
    assert found is not None
    assert found.state == "Valid"  # the failure is the film's, and stated
    assert any("hash" in problem for problem in found.film_problems)
    whole = credentials.read(credited)
    assert whole is not None
    assert not whole.film_problems
    start = content.index(b"jumb") + 60
    content[start : start + 140] = bytes(140)
    film.write_bytes(content)
    assert credentials.film_problem(film)[1]  # what cannot be read cannot be signed over


def test_a_good_key_can_sign(signer: Signer) -> None:
    assert credentials.problem(signer, ".mp4") == ""
    assert "cannot carry credentials" in credentials.problem(signer, ".mkv")


@pytest.mark.parametrize("wrong", ["other key", "junk key", "junk chain", "no file", "root alone"])
def test_a_key_that_cannot_sign_is_found_before_any_work(
    place: Path, tmp_path: Path, signer: Signer, wrong: str
) -> None:
    junk, root = tmp_path / "junk.pem", tmp_path / "root.pem"
    junk.write_bytes(b"-----BEGIN nothing")
    chain = signer.certificate.read_text()
    root.write_text(chain[chain.rindex("-----BEGIN") :])
    other = {
        "other key": Signer(signer.certificate, write_chain(tmp_path, "other").key),
        "junk key": Signer(signer.certificate, junk),
        "junk chain": Signer(junk, signer.key),
        "no file": Signer(tmp_path / "gone.pem", signer.key),
        "root alone": Signer(root, signer.key),
    }[wrong]
    assert credentials.problem(other, ".mp4").startswith("cannot sign: ")
    with pytest.raises(StageError):
        credentials.sign(place / "dub.mp4", tmp_path / "y.mp4", other, place / "film.mp4", {})
    assert not (tmp_path / "y.mp4").exists()
