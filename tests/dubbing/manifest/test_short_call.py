"""The manifest of one film and one recording: what is written, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dubbing.errors import CallError, ManifestError
from dubbing.manifest import short_call
from dubbing.manifest.manifest import load
from tests import clips

pytestmark = pytest.mark.medium
CONSENT = "Ann Smith, release form 17, page 2"


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("footage")
    clips.write_clip(folder / "Ann's film.mp4", 30)
    clips.write_sound(folder / "it.wav", 1.5)
    return folder


def call(footage: Path, out: Path, **changed: Any) -> tuple[Path, str]:
    """As the command does."""
    given: dict[str, Any] = {"clip": footage / "Ann's film.mp4", "speech": footage / "it.wav"}
    given |= {"out": out, "consent": CONSENT, **changed}
    with short_call.written(**given) as found:
        load(found[0])
        return found


def test_the_manifest_lies_beside_the_result(footage: Path, tmp_path: Path) -> None:
    path, name = call(footage, tmp_path / "new" / "it.mp4")
    assert (path, name) == (tmp_path / "new" / "it.yaml", "it")
    production = load(path)
    dub = production.dubs["it"]
    assert production.output / dub.results()["video"] == tmp_path / "new" / "it.mp4"
    (person,) = production.people.values()
    assert (person.name, person.consent.terms["by"]) == ("Ann's film", "Ann Smith")
    assert person.consent.terms["reference"] == "release form 17, page 2"
    before = path.read_bytes()
    call(footage, tmp_path / "new" / "it.mp4")
    assert path.read_bytes() == before
    codecs = {"it.mov": "prores", "it.mkv": "ffv1"}
    for file, codec in codecs.items():
        out = tmp_path / codec / file
        (dub,) = load(call(footage, out)[0]).dubs.values()
        assert (dub.settings.codec, dub.results()["video"]) == (codec, file)


def test_a_preview_is_a_second_dub_of_the_same_person(footage: Path, tmp_path: Path) -> None:
    out = tmp_path / "it.mp4"
    path, name = call(footage, out, preview=0.5)
    assert name == "it.preview"
    production = load(path)
    assert {n: dub.length for n, dub in production.dubs.items()} == {"it": 38, "it.preview": 13}
    assert len(production.people) == 1
    assert call(footage, out, preview=0.8)[1] == "it.preview"
    assert load(path).dubs["it.preview"].length == 20
    assert call(footage, out) == (path, "it")
    assert "it.preview" in load(path).dubs  # its results stay known


def test_another_manifest_is_left_alone(footage: Path, tmp_path: Path) -> None:
    out = tmp_path / "it.mp4"
    path, _ = call(footage, out)
    for text in ("mine", path.read_text() + "# a remark\n"):
        path.write_text(text)
        with pytest.raises(CallError, match="is not what this call would write"):
            call(footage, out)
        assert path.read_text() == text


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"clip": Path("nobody.mp4")}, "no such file"),
        ({"consent": ""}, "who agreed, and where is that written down?"),
        ({"consent": "Ann Smith"}, "who agreed, and where is that written down?"),
        ({"consent": ", form 17"}, "who agreed"),
        ({"out": Path("it.avi")}, "no video is written as 'it.avi'"),
    ],
)
def test_a_wrong_call_writes_nothing(
    footage: Path, tmp_path: Path, changed: dict[str, Any], words: str
) -> None:
    changed = {key: tmp_path / v if isinstance(v, Path) else v for key, v in changed.items()}
    with pytest.raises(CallError) as caught:
        call(footage, **({"out": tmp_path / "it.mp4"} | changed))
    assert words in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_manifest_that_proves_wrong_does_not_stay(footage: Path, tmp_path: Path) -> None:
    out = tmp_path / "it.mp4"
    with pytest.raises(ManifestError, match="is a placeholder"):
        call(footage, out, consent="TODO, form 17")
    assert not list(tmp_path.iterdir())
    path, _ = call(footage, out)
    before = path.read_bytes()
    with pytest.raises(ManifestError, match="there are only"):
        call(footage, out, preview=60)
    assert path.read_bytes() == before
