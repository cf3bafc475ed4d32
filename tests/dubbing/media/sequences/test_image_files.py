"""Image files as post houses write them: layers, data windows, and how they are numbered."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest

from dubbing.engine.disk.numbered import with_options
from dubbing.errors import MediaError
from dubbing.media import probe
from dubbing.media.sequences import image_files, sequence
from dubbing.video.nuke import script
from tests import sequences

GREY = np.full((48, 64, 3), 0.18, np.float16)
RGB_OF = [
    ("B G R Z diffuse.B diffuse.G diffuse.R", (2, 1, 0)),
    ("albedo.R albedo.G albedo.B R G B", (3, 4, 5)),
    ("beauty.R beauty.G beauty.B depth.Z", (0, 1, 2)),
]


@pytest.mark.parametrize(("names", "colours"), RGB_OF)
def test_the_colours_are_those_of_no_layer_or_of_the_only_one(
    names: str, colours: tuple[int, ...]
) -> None:
    assert image_files._colours(Path("a.exr"), names.split()) == colours


@pytest.mark.parametrize(
    ("names", "words"), [("Z", "no R, G and B"), ("a.R a.G a.B b.R b.G b.B", "the layers a, b,")]
)
def test_colours_that_are_not_there_or_of_several_layers(names: str, words: str) -> None:
    with pytest.raises(MediaError, match=words):
        image_files._colours(Path("a.exr"), names.split())


def windowed(folder: Path, corners: list[int]) -> Path:
    """A film of which each frame has its data window at a column of a display window of 80x60."""
    for number, corner in enumerate(corners, 1001):
        spec = OpenImageIO.ImageSpec(64, 48, 3, "half")
        spec.x, spec.full_width, spec.full_height = corner, 80, 60
        target: Any = OpenImageIO.ImageOutput.create(str(folder / f"shot.{number}.exr"))
        assert target.open(str(folder / f"shot.{number}.exr"), spec)
        assert target.write_image(GREY)
        target.close()
    return with_options(folder / "shot.####.exr", {"rate": "24"})


def test_a_data_window_that_moves_is_refused(tmp_path: Path) -> None:
    path = windowed(tmp_path, [0, 1])
    with pytest.raises(MediaError, match=r"data window at \(1, 0\), the first at \(0, 0\)"):
        list(sequence.read_frames(path, 0, None, Fraction(24)))


def test_a_data_window_within_the_display_window(tmp_path: Path) -> None:
    path = windowed(tmp_path, [8, 8])
    assert len(list(sequence.read_frames(path, 0, None, Fraction(24)))) == 2
    assert (probe(path).width, probe(path).height) == (64, 48)
    assert 'format "80 60 0 0 80 60 1 film"' in script(path, Fraction(24))


@pytest.mark.parametrize(("first", "name"), [(0, "0000"), (1234567, "1234567")])
def test_numbers_begin_anywhere(tmp_path: Path, first: int, name: str) -> None:
    path = sequences.write_sequence(tmp_path / "shot.####.exr", [GREY], first, rate=24)
    assert sequence.read(path, 0).path.name == f"shot.{name}.exr"


def test_negative_numbers_are_refused(tmp_path: Path) -> None:
    for number in (-2, -1):
        sequences.write_image(tmp_path / f"shot.{number:05d}.exr", GREY, rate=24)
    with pytest.raises(MediaError, match="numbers are 0 or more"):
        probe(tmp_path / "shot.####.exr")


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float"])
def test_opacity_changes_no_colour(tmp_path: Path, kind: str) -> None:
    """Of a matte beside straight colours, as a TIFF has it, they would be black where it is 0."""
    values = np.random.default_rng(0).random((8, 9, 4), np.float32)
    values[:4, :, 3] = 0
    stored = values if kind == "float" else (values * np.iinfo(kind).max).astype(kind)
    header = OpenImageIO.ImageSpec(9, 8, 4, kind)
    header.attribute("oiio:UnassociatedAlpha", 1)
    image_files.write_image(tmp_path / "a.tif", stored, header)
    image = image_files.read_image(tmp_path / "a.tif")
    np.testing.assert_array_equal(image.stored, stored)
    image_files.write_image(tmp_path / "b.tif", image.stored, image.header)
    np.testing.assert_array_equal(image_files.read_image(tmp_path / "b.tif").stored, stored)
