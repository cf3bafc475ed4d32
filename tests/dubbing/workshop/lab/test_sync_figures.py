"""Lip sync of a render beside its source's."""

import pytest

from dubbing.workshop.lab.sync_figures import suspicion

pytestmark = pytest.mark.medium


def test_a_render_that_beats_its_source_is_suspicious() -> None:
    found = suspicion(0.235, 0.174)
    assert found["suspicious"] is True
    assert "0.235 is above the source's own 0.174" in found["suspicion"]
    assert suspicion(0.174, 0.174) == {"suspicious": False}
    assert suspicion(None, 0.2) == {}  # there was no face to look at
