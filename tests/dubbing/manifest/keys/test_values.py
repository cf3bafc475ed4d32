"""Values of a manifest that depend on the system."""

from pathlib import Path

import pytest

from dubbing.engine.disk import files
from dubbing.manifest.keys.values import as_name, check_name, place_of

REFUSED = ("nul", "Con", "aux.it", "COM1", "lpt\u00b9", "who?", 'a"b', "a|b", "ends.")
KEPT = ("null", "contract", "com", "coma.it", "a.b", "Ann's dub")


@pytest.mark.parametrize("name", [*REFUSED, *KEPT])
def test_a_name_that_windows_cannot_have_is_refused_there(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert check_name(name) == name
    monkeypatch.setattr(files, "WINDOWS", True)
    if name in KEPT:
        assert check_name(name) == name
        return
    with pytest.raises(ValueError, match="on Windows: give another one"):
        check_name(name)


@pytest.mark.parametrize("file", ["a.", "Ann's dub", "x" * 100, "\u65e5" * 70, "a\u0308"])
def test_a_file_whose_name_may_be_one_keeps_it(file: str) -> None:
    assert as_name(file) == check_name(file) == file


def test_names_of_files_that_cannot_be_one_are_changed() -> None:
    assert as_name("Screencast 10:47") == check_name("Screencast 10-47")
    assert as_name(" .a\tb/c\\d ") == check_name("a-b-c-d")
    for letter in ("x", "\u65e5"):
        italian, german = (as_name(f"{letter * 150}_{language}") for language in ("it", "de"))
        assert check_name(italian).endswith("_it")
        assert check_name(german).endswith("_de")


@pytest.mark.parametrize(("there", "written"), [("a\u0308", "\u00e4"), ("\u00e4", "a\u0308")])
def test_a_file_is_found_whatever_the_form_of_its_accents(
    tmp_path: Path, there: str, written: str
) -> None:
    film = tmp_path / f"{there} folder" / f"{there}.mp4"
    film.parent.mkdir()
    film.touch()
    assert place_of(f"{written} folder/{written}.mp4", tmp_path).samefile(film)
    assert place_of(f"{written} folder/new.mp4", tmp_path) == film.with_name("new.mp4")
