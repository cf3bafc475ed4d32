"""Frames are decoded late, and have the same keys only where they show the same."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.media.reading import late_frames as late

RATE, SEGMENT, COUNT = Fraction(30000, 1001), 12, 60


def film(folder: Path, codec: str, changed: int | None = None) -> Path:
    """A video of segments, as a dub is joined of them; one of its frames may be another."""
    frames = np.random.default_rng(0).integers(0, 256, (COUNT, 8, 8, 3), np.uint8)
    if changed is not None:
        frames[changed] = 255 - frames[changed]
    parts = []
    for first in range(0, COUNT, SEGMENT):
        part = folder / f"{codec}-{changed}-{first}.mov"
        with media.VideoWriter(part, 64, 64, RATE, codec) as writer:
            for frame in frames[first : first + SEGMENT]:
                writer.write(np.kron(frame, np.ones((8, 8, 1), np.uint8)))
        parts.append((part, SEGMENT / RATE))
    silence, out = folder / "silence.wav", folder / f"{codec}-{changed}{media.SUFFIX[codec]}"
    soundfile.write(silence, np.zeros(64_000), 16_000)
    media.mux(parts, silence, out, audio_start=0, seconds=2, audio_codec=media.SOUND[codec])
    return out


@pytest.mark.parametrize("codec", ["h264", "prores"])
def test_frames_of_segments_that_are_the_same_have_the_same_keys(
    tmp_path: Path, codec: str
) -> None:
    one, other = (late.group_keys(film(tmp_path, codec, k)) for k in (None, 30))
    same = np.array([a == b for a, b in zip(one, other, strict=True)])
    length = SEGMENT if codec == "h264" else 1  # each frame is a key frame
    assert same.sum() == COUNT - length
    assert not same[30 // length * length : 30 // length * length + length].any()
    assert len(set(one)) == COUNT


def test_other_codecs_have_no_keys(tmp_path: Path) -> None:
    assert late.group_keys(film(tmp_path, "hevc")) == []


def test_a_frame_is_the_same_however_late_it_is_read(tmp_path: Path) -> None:
    path = film(tmp_path, "h264")
    frames = list(late.late_frames(path, keyed=False))
    assert {frame.key for frame in frames} == {""}
    for number, expected in enumerate(media.read_frames(path)):
        if number in (3, 4, 50):  # in order, and after a gap
            np.testing.assert_array_equal(frames[number].image, expected)
    first = next(iter(media.read_frames(path)))
    np.testing.assert_array_equal(frames[0].image, first)  # back again
