from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.errors import ExplainedError, MediaError
from dubbing.media.properties.colour import Colour
from tests import clips


@pytest.mark.parametrize(
    ("codec", "pixels", "channels"),
    [("ffv1", "rgb24", (3,)), ("ffv1-rgba", "rgba", (4,)), ("ffv1-gray", "gray", ())],
)
def test_lossless_is_lossless(
    tmp_path: Path, codec: str, pixels: str, channels: tuple[int, ...]
) -> None:
    noise = np.random.default_rng(0)
    frames = noise.integers(0, 256, (4, 33, 47, *channels), dtype=np.uint8)
    with media.VideoWriter(tmp_path / "x.mkv", 47, 33, Fraction(25), codec) as writer:
        for frame in frames:
            writer.write(frame)
    back = np.stack(list(media.read_frames(tmp_path / "x.mkv", pixels=pixels)))
    np.testing.assert_array_equal(back, frames)


@pytest.mark.parametrize(("codec", "suffix"), [("h264", ".mp4"), ("prores", ".mov")])
def test_colours_survive(tmp_path: Path, codec: str, suffix: str) -> None:
    colours = np.array([[200, 40, 40], [40, 200, 40], [40, 40, 200], [128, 128, 128]], np.uint8)
    picture = np.repeat(np.repeat(colours[None], 64, 0), 16, 1)
    with media.VideoWriter(tmp_path / f"x{suffix}", 64, 64, Fraction(25), codec) as writer:
        writer.write(picture)
    info = media.probe(tmp_path / f"x{suffix}")
    assert info.colour == Colour()
    (back,) = media.read_frames(tmp_path / f"x{suffix}")
    for k in range(4):
        middle = back[8:-8, 16 * k + 5 : 16 * k + 11].reshape(-1, 3).mean(0)
        assert np.abs(middle - colours[k]).max() < 4


def test_odd_sides_are_made_even(tmp_path: Path) -> None:
    with media.VideoWriter(tmp_path / "x.mp4", 35, 21, Fraction(25)) as writer:
        writer.write(np.full((21, 35, 3), 90, np.uint8))
    info = media.probe(tmp_path / "x.mp4")
    assert (info.width, info.height) == (36, 22)


def test_the_same_frames_give_the_same_bytes(tmp_path: Path) -> None:
    first = clips.write_video(tmp_path / "a.mp4", 20)
    second = clips.write_video(tmp_path / "b.mp4", 20)
    assert first.read_bytes() == second.read_bytes()


def test_an_error_leaves_the_old_file(tmp_path: Path) -> None:
    path = clips.write_video(tmp_path / "a.mp4", 3)
    before = path.read_bytes()
    with pytest.raises(MediaError), media.VideoWriter(path, 64, 48, Fraction(25)) as writer:
        writer.write(clips.frame(0)[:10])
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]


def test_a_frame_of_another_shape_is_reported(tmp_path: Path) -> None:
    with (
        pytest.raises(MediaError, match="48, 64, 3"),
        media.VideoWriter(tmp_path / "a.mp4", 64, 48, Fraction(25)) as writer,
    ):
        writer.write(np.zeros((48, 65, 3), np.uint8))


def test_a_folder_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with (
        pytest.raises(ExplainedError, match=r"File exists.*see whether"),
        media.VideoWriter(tmp_path / "file" / "a.mp4", 64, 48, Fraction(25)) as writer,
    ):
        writer.write(clips.frame(0))
