"""The picture of several methods side by side."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.preparation.prepared import PreparedClip
from dubbing.workshop.lab import tiles
from tests import clips
from tests.fakes import write_prepared

pytestmark = pytest.mark.medium


FIRST, COUNT, SIZE = 5, 12, 32


@pytest.fixture
def clip(tmp_path: Path) -> PreparedClip:
    clips.write_video(tmp_path / "clip.mkv", FIRST + COUNT, codec="ffv1")
    (tmp_path / "prepared").mkdir()
    prepared = write_prepared(tmp_path / "clip.mkv", tmp_path / "prepared")
    landmarks = prepared.landmarks.copy()
    turns = np.linspace(0, 2 * np.pi, len(OUTER_LIP))
    landmarks[:, OUTER_LIP] = np.stack([16 + 4 * np.cos(turns), 24 + 2 * np.sin(turns)], 1)
    return replace(prepared, landmarks=landmarks)


def plain(colour: tuple[int, int, int]) -> np.ndarray:
    return np.full((SIZE, SIZE, 3), colour, np.uint8)


def source(k: int) -> np.ndarray:
    """Grey as the frame's number, with a red mouth."""
    picture = plain((10 * k, 10 * k, 10 * k))
    picture[20:28, 8:24] = (255, 0, 0)
    return picture


def write(folder: Path, colour: tuple[int, int, int], first: int = FIRST) -> None:
    shown = tiles.tile_frames(first, COUNT)
    tiles.write_tiles(folder, [np.concatenate([source(k), plain(colour)]) for k in shown])


def read(folder: Path) -> np.ndarray:
    picture = cv2.imread(str(folder / tiles.METHODS_FILE))
    assert picture is not None
    return picture[..., ::-1]


def test_about_twenty_frames_are_shown() -> None:
    assert list(tiles.tile_frames(100, 12)) == list(range(100, 112))
    assert list(tiles.tile_frames(100, 250)) == list(range(100, 350, 12))


def test_rows_are_the_source_and_every_method_then_their_mouths(
    clip: PreparedClip, tmp_path: Path
) -> None:
    green, blue = (0, 200, 0), (0, 0, 200)
    write(tmp_path / "two", blue)
    write(tmp_path / "one", green)
    tiles.write_methods(tmp_path / "two", clip, FIRST, COUNT)
    picture = read(tmp_path)
    side, strip = tiles.SIDE, tiles.STRIP
    assert picture.shape == (3 * (side + strip), tiles.COLUMNS * side, 3)
    columns = np.arange(tiles.COLUMNS) * side + side // 2
    # First and last of the shown frames, and others between them.
    greys = picture[side // 3, columns, 0]
    assert greys[0] == 10 * FIRST
    assert greys[-1] == 10 * (FIRST + COUNT - 1)
    assert (np.diff(greys.astype(int)) > 0).all()
    assert (picture[side + side // 2, columns] == green).all()
    assert (picture[2 * side + side // 2, columns] == blue).all()
    # The mouth is in the middle of its strip, larger than it was.
    row = picture[3 * side + strip // 2, :side]
    assert (row[side // 2] == (255, 0, 0)).all()
    assert (row == (255, 0, 0)).all(1).mean() > 0.75
    assert (picture[3 * side + strip + strip // 2, columns] == green).all()
    assert (picture[3 * side + 2 * strip + strip // 2, columns] == blue).all()


def test_tiles_of_other_frames_are_left_out(clip: PreparedClip, tmp_path: Path) -> None:
    write(tmp_path / "one", (0, 200, 0), first=FIRST - 1)
    write(tmp_path / "two", (0, 0, 200))
    tiles.write_methods(tmp_path / "two", clip, FIRST, COUNT)
    picture = read(tmp_path)
    assert len(picture) == 2 * (tiles.SIDE + tiles.STRIP)
    assert (picture[tiles.SIDE + tiles.SIDE // 2, 0] == (0, 0, 200)).all()
