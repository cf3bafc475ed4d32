"""Coded pictures, and the frames of a part of a video."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from dubbing import media
from dubbing.errors import MediaError
from tests import clips

pytestmark = pytest.mark.medium


@pytest.mark.parametrize("codec", ["h264", "prores", "ffv1"])
@pytest.mark.parametrize("rate", [Fraction(25), Fraction(24000, 1001), Fraction(30000, 1001)])
def test_frames_of_a_part_are_counted(tmp_path: Path, rate: Fraction, codec: str) -> None:
    path = clips.write_video(tmp_path / f"v{media.SUFFIX[codec]}", 40, rate, codec=codec)
    for first, stop in ((0, 40), (0, 7), (13, 14), (13, 30), (33, 40), (38, 60)):
        assert media.count_frames(path, first, stop) == min(stop, 40) - first
    assert media.count_frames(path) == 40


def test_a_picture_that_changed_has_another_digest(tmp_path: Path) -> None:
    path = clips.write_video(tmp_path / "v.mov", 12, codec="prores")
    before = media.coded_pictures(path)
    assert len(set(before)) == 12
    content = bytearray(path.read_bytes())
    begins = [k for k in range(len(content) - 4) if content[k : k + 4] == b"icpf"]
    content[begins[5] + 300] ^= 1
    path.write_bytes(content)
    after = media.coded_pictures(path)
    assert [k for k in range(12) if before[k] != after[k]] == [5]


def test_they_are_in_the_order_of_showing(tmp_path: Path) -> None:
    """A film that is cut after its third group of pictures begins with the same ones."""
    path = clips.write_video(tmp_path / "v.mp4", 40)
    clips.ffmpeg("-i", path, "-c:v", "libx264", "-g", "10", "-bf", "3", tmp_path / "b.mp4")
    media.cut(tmp_path / "b.mp4", tmp_path / "c.mov", 10, 20)
    whole, part = (media.coded_pictures(tmp_path / name) for name in ("b.mp4", "c.mov"))
    assert (len(whole), part) == (40, whole[10:30])


def test_what_is_no_video_is_explained(tmp_path: Path) -> None:
    sound = clips.write_sound(tmp_path / "a.wav", 1)
    for reads in (media.coded_pictures, media.count_frames):
        with pytest.raises(MediaError, match="cannot be"):
            reads(sound)
