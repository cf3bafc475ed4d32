"""The still of a signed dub."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from tests import fakes
from tests.dubbing.batches import dub, manifest_of
from tests.dubbing.provenance.chain import write_chain


def test_a_signed_dub_has_a_still(
    footage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("c2pa")
    fakes.install(monkeypatch.setattr)
    write_chain(tmp_path)
    signed = f", certificate: {tmp_path}/signer.pem, key: {tmp_path}/signer.key"
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, signed)
    assert "ann_it:still" in dub(path)[1]
    still = tmp_path / "out" / "work" / "dubs" / "ann_it" / "still" / "still.png"
    assert Image.open(still).size == (64, 48)
    assert dub(path)[1] == []
