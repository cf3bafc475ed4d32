"""Interlaced film is noticed wherever it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubbing.media.probing.fields import is_flagged, looks_interlaced
from tests import clips

pytestmark = pytest.mark.medium

MOVING = "testsrc2=s=320x240:r=50"
FIELDS = "tinterlace=interleave_top"
TWICE = "fps=12.5,fps=25"  # each picture stands for two frames


def film(path: Path, *parts: tuple[bool, float]) -> Path:
    """MPEG-TS of parts one after another, interlaced or not, of so many seconds."""
    begin, content = 0.0, b""
    for k, (interlaced, seconds) in enumerate(parts):
        part = path.with_name(f"{k}.ts")
        looks = f"{FIELDS},setfield=tff" if interlaced else "fps=25"
        flags = ("-flags", "+ilme+ildct") if interlaced else ()
        source = ("-f", "lavfi", "-i", f"{MOVING}:d={seconds}", "-vf", looks, *flags)
        codec = ("-c:v", "libx264", "-g", "25", "-bf", "0", "-muxdelay", "0")
        clips.ffmpeg(*source, *codec, "-output_ts_offset", str(begin), part)
        content += part.read_bytes()
        begin += seconds
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("parts", "interlaced"),
    [
        ([(False, 4.0)], False),
        ([(True, 4.0)], True),
        ([(False, 0.4), (True, 3.6)], True),
        ([(False, 2.0), (True, 0.4), (False, 2.0)], True),
        ([(False, 3.6), (True, 0.4)], True),
    ],
)
def test_flags_are_looked_at_all_over_a_film(
    tmp_path: Path, parts: list[tuple[bool, float]], interlaced: bool
) -> None:
    assert is_flagged(film(tmp_path / "film.ts", *parts)) == interlaced


@pytest.mark.parametrize(
    ("looks", "interlaced"), [(FIELDS, True), ("fps=25", False), (TWICE, False)]
)
@pytest.mark.parametrize("suffix", [".mp4", ".ts"])
def test_what_is_not_flagged_is_seen(
    tmp_path: Path, looks: str, interlaced: bool, suffix: str
) -> None:
    path = tmp_path / f"film{suffix}"
    source = ("-f", "lavfi", "-i", f"{MOVING}:d=3", "-vf", f"{looks},setfield=prog")
    clips.ffmpeg(*source, "-c:v", "libx264", "-g", "25", path)
    assert not is_flagged(path)
    assert looks_interlaced(path) == interlaced
