"""Values of a manifest that depend on the system."""

import pytest

from dubbing.engine.disk import files
from dubbing.manifest.keys.values import check_name

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
