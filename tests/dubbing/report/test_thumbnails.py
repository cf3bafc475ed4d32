"""Images of dubs on the page."""

from pathlib import Path

import pytest

from dubbing.errors import MediaError
from dubbing.report import thumbnails
from tests import clips


def test_an_image_that_fails_once_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    video = clips.write_clip(tmp_path / "it.mp4", 3)
    own, failures = thumbnails._image, [MediaError("broke off", "it.mp4")]

    def once(*of: object) -> bytes:
        if failures:
            raise failures.pop()
        return own(video, 1)

    monkeypatch.setattr(thumbnails, "_image", once)
    found = thumbnails.thumbnail_of(video, 1, tmp_path)
    assert found is not None
    assert found.read_bytes() == own(video, 1)
    failures += [MediaError("broke off", "it.mp4")] * 2
    found.unlink()
    assert thumbnails.thumbnail_of(video, 1, tmp_path) is None
