"""The stage `composite` knows what each of its heads is made of."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.pieces import Pieces
from dubbing.engine.graph.stage import Stage
from dubbing.stages.composite import digests_of_heads
from tests import fakes

FRAMES = 2 * fakes.HEADS_A_FILE


@pytest.fixture
def rendered(tmp_path: Path) -> Stage:
    """A stage that made heads, in two files."""
    fakes.write_heads(tmp_path, FRAMES, Fraction(25))
    return replace(Stage(), folder=tmp_path)


def test_one_head_that_is_made_of_something_else_changes_no_other(rendered: Stage) -> None:
    def digests(parts: list[int]) -> list[str]:
        for first in range(0, FRAMES, fakes.HEADS_A_FILE):
            made_of = parts[first : first + fakes.HEADS_A_FILE]
            Pieces(rendered.folder, None).same(f"{first:06d}.mkv", made_of)
        return digests_of_heads(rendered, 1, FRAMES - 2)

    parts = list(range(FRAMES))
    before = digests(parts)
    assert len(set(before)) == FRAMES - 2
    parts[fakes.HEADS_A_FILE] = -1  # the first of the second file
    after = digests(parts)
    changed = [k for k, (a, b) in enumerate(zip(before, after, strict=True), 1) if a != b]
    assert changed == [fakes.HEADS_A_FILE]


def test_heads_without_a_note_are_made_of_their_files(rendered: Stage) -> None:
    (first, second) = sorted(rendered.folder.glob("*.mkv"))
    assert digests_of_heads(rendered, 0, FRAMES) == [digest_of(first), digest_of(second)]
    assert digests_of_heads(rendered, fakes.HEADS_A_FILE, 1) == [digest_of(second)]
