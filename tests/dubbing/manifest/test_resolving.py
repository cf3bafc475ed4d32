"""The production of a manifest: names of clips."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from dubbing.engine.disk.files import same_on_disk
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.resolving import clip_name

NAMES = [
    ["ann", "x/a", "y/a", "z/a-1", "w/a-2"],
    ["ann", "x/a-2", "y/a", "z/a", "w/a-3"],
    ["ann", "x/A", "y/a", "z/A-2"],
    ["ann", "x/é", f"y/{unicodedata.normalize('NFD', 'é')}", "z/É-2"],
    ["x/a", "y/a", "z/a"],
]


@pytest.mark.parametrize("names", NAMES)
def test_no_two_clips_share_a_folder(names: list[str]) -> None:
    films = tuple(Path(f"/{name}.mp4") for name in names)
    identity = Identity.model_construct(clips=films, clip=films[0])
    found = [clip_name(identity, film) for film in films]
    assert found[0] == ""
    assert len({same_on_disk(name) for name in found}) == len(films)
    # One more at the end changes no name: what was made stays where it is.
    more = identity.model_copy(update={"clips": (*films, Path("/v/a.mp4"))})
    assert [clip_name(more, film) for film in films] == found
