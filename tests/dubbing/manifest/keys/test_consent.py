"""Consent is to something, and by somebody: what lies outside is refused before any work."""

from __future__ import annotations

import datetime
import hashlib
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.errors import CallError, ManifestError
from dubbing.manifest.checks.terms import covers
from dubbing.manifest.manifest import load
from tests import clips
from tests.dubbing.manifest.checks.test_provenance import footage, problems, read

__all__ = ["footage"]
WHO = 'by: "Ann Smith", reference: "form 17"'
TODAY = datetime.date.today()
TOMORROW, YESTERDAY = TODAY + datetime.timedelta(1), TODAY - datetime.timedelta(1)


@pytest.mark.parametrize("key", ["by", "reference"])
@pytest.mark.parametrize(
    "text", ["TODO", "<name>", "[your name]", "n/a", "unknown", "XXX", "t.b.d.", "Full name", "..."]
)
def test_placeholders_are_refused(footage: Path, key: str, text: str) -> None:
    words = {"by": "Ann Smith", "reference": "form 17", key: text}
    (found,) = problems(footage, consent=yaml.safe_dump(words, default_flow_style=True).strip())
    assert f"consent.{key}" in found
    assert "placeholder" in found or "must not be empty" in found


@pytest.mark.parametrize("text", ["Ann Name", "Nadia Todorova", "NA-17/2026", "unknown soldier 3"])
def test_real_words_are_no_placeholders(footage: Path, text: str) -> None:
    assert read(footage, consent=f'{{by: "{text}", reference: "{text}"}}')


@pytest.mark.parametrize(
    ("terms", "dub", "message"),
    [
        ("languages: [it, de]", "", "dubs[0].language: is required"),
        ("languages: [it, de]", "language: fr", "is for it, de, not for fr"),
        ("languages: [it-CH]", "language: it", "is for it-CH, not for it"),
        ("languages: []", "language: it", "consent.languages: must not be empty"),
        ("languages: [italian]", "language: it", "languages[0]: must be the code of a language"),
        ("languages: [it]", "language: it_IT", "dubs[0].language: must be the code of a language"),
        ("until: 31.12.2027", "", "consent.until: must be a day as 2026-11-02, not '31.12.2027'"),
        ("until: 2027", "", "consent.until: must be a day as 2026-11-02, not 2027"),
        (f"until: {YESTERDAY}", "", f"ended on {YESTERDAY}"),
        (f"date: {TOMORROW}", "", "is still to come"),
        ("films: [it.wav]", "", "does not name this film"),
        (f"films: ['{'0' * 64}']", "", "does not name this film"),
        ("file: gone.pdf", "", "no such file"),
        (f"file: it.wav, sha256: '{'0' * 64}'", "", "is not what was agreed to"),
        (f"sha256: '{'0' * 64}'", "", "belongs to a file"),
        ("file: it.wav, sha256: abc", "", "consent.sha256: must be 64 hexadecimal digits"),
        ("colour: red", "", "unknown key"),
    ],
)
def test_a_dub_outside_of_its_terms_is_refused(
    footage: Path, terms: str, dub: str, message: str
) -> None:
    found = problems(footage, dub, f"{{{WHO}, {terms}}}")
    assert any(message in problem for problem in found), found


def test_a_dub_within_its_terms_is_accepted_and_its_terms_are_recorded(footage: Path) -> None:
    digest = hashlib.sha256((footage / "host.mp4").read_bytes()).hexdigest()
    paper = hashlib.sha256((footage / "it.wav").read_bytes()).hexdigest()
    for film in ("host.mp4", digest):
        terms = f"languages: [it, de], until: {TODAY}, date: {TODAY}, films: ['{film}']"
        manifest = read(
            footage, "language: it-CH", f"{{{WHO}, {terms}, file: it.wav, sha256: {paper}}}"
        )
        assert manifest.people["host"].consent.record() == {
            "by": "Ann Smith",
            "reference": "form 17",
            "date": str(TODAY),
            "until": str(TODAY),
            "languages": ["it", "de"],
            "films": [film],
            "sha256": paper,
        }


def test_the_film_of_a_dub_is_one_that_was_agreed_to(footage: Path) -> None:
    clips.write_clip(footage / "other.mp4", 80)
    terms = f"{{{WHO}, films: [host.mp4]}}"
    text = (footage / "m.yaml").read_text() if read(footage, consent=terms) else ""
    text = text.replace("clip: host.mp4", "clips: [host.mp4, other.mp4]")
    for film, allowed in (("host.mp4", True), ("other.mp4", False)):
        (footage / "m.yaml").write_text(text.replace("audio:", f"clip: {film}, audio:"))
        if allowed:
            assert load(footage / "m.yaml")
            continue
        with pytest.raises(ManifestError, match=r"does not name its film, other.mp4"):
            load(footage / "m.yaml")


def test_in_a_scene_everybodys_own_consent_counts(footage: Path) -> None:
    clips.write_clip(footage / "film.mp4", 80)
    clips.write_clip(footage / "bob.mp4", 80)
    (footage / "it.csv").write_text("in,out,speaker,words\n0,1,ANN,a\n1,2,BOB,b\n")
    people = {"ann": "host.mp4", "bob": "bob.mp4"}
    identities = {
        name: {"clips": [own, "film.mp4"], "seconds": 1, "consent": {"by": name, "reference": "17"}}
        for name, own in people.items()
    }
    dub = {"lines": "it.csv", "speakers": {"ANN": "ann", "BOB": "bob"}, "clip": "film.mp4"}
    content = {"version": 1, "output": "out", "identities": identities}
    path = footage / "scene.yaml"
    path.write_text(yaml.safe_dump({**content, "dubs": [{**dub, "audio": "it.wav"}]}))
    assert load(path)
    identities["bob"]["consent"] = {"by": "Bob", "reference": "17", "films": ["bob.mp4"]}
    path.write_text(yaml.safe_dump({**content, "dubs": [{**dub, "audio": "it.wav"}]}))
    with pytest.raises(ManifestError, match=r"the consent of Bob does not name its film, film.mp4"):
        load(path)


def test_a_form_is_recorded_beside_the_file_that_it_names(footage: Path) -> None:
    form = footage / "form.yaml"
    form.write_text('by: Ann\nreference: "17"\nfile: it.wav\n')
    recorded = read(footage, consent="form.yaml").people["host"].consent.record()
    digests = [hashlib.sha256((footage / name).read_bytes()) for name in ("form.yaml", "it.wav")]
    assert [recorded["sha256"], recorded["file_sha256"]] == [d.hexdigest() for d in digests]
    form.write_text('by: Ann\nreference: "17"\nform: it.wav\n')
    assert "cannot name another" in problems(footage, consent="form.yaml")[0]
    (found,) = problems(footage, consent=f"{{{WHO}, form: it.wav}}")
    assert "form is no key" in found


def test_a_language_covers_its_kinds() -> None:
    assert covers("it", "it")
    assert covers("pt", "pt-BR")
    assert covers("DE", "de-at")
    assert not covers("pt-BR", "pt")
    assert not covers("fi", "fil")


def test_a_form_is_refused_until_it_is_filled_in(footage: Path) -> None:
    form = footage / "ann.yaml"
    result = CliRunner().invoke(app, ["consent", str(form)])
    assert result.exit_code == 0, result.output
    (found,) = problems(footage, consent="ann.yaml")
    assert "by is blank in" in found
    filled = {"by": "Ann Smith", "date": str(TODAY), "reference": "archive 17"}
    text = form.read_text()
    for key, value in filled.items():
        text = text.replace(f"\n{key}: ", f"\n{key}: {value} ")
    form.write_text(text)
    (found,) = problems(footage, consent="ann.yaml")
    assert "languages is blank" in found
    kept = [line for line in text.splitlines() if not line.startswith(("until", "films"))]
    form.write_text("\n".join(kept).replace("languages: []", "languages: [it]"))
    (found,) = problems(footage, consent="ann.yaml")
    assert "dubs[0].language: is required" in found
    recorded = read(footage, "language: it", "ann.yaml").people["host"].consent.record()
    assert recorded["languages"] == ["it"]
    assert recorded["sha256"] == hashlib.sha256(form.read_bytes()).hexdigest()
    again = CliRunner().invoke(app, ["consent", str(form)])
    assert isinstance(again.exception, CallError)


@pytest.mark.parametrize(
    "content", [b"", b"[1, 2]", b"a: [", b"\xff\xfe", b"by: 1\nby: 2", b"x" * 200_000]
)
def test_what_is_no_form_is_reported(footage: Path, content: bytes) -> None:
    (footage / "odd.yaml").write_bytes(content)
    (found,) = problems(footage, consent="odd.yaml")
    assert "the form" in found
    assert "odd.yaml cannot be read" in found
