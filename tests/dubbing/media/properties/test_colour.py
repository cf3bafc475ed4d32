"""Colours, timecode and field order: from a file, through our encoder, into another."""

from __future__ import annotations

import itertools
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.errors import MediaError
from dubbing.media.probing.fields import is_flagged
from dubbing.media.properties.colour import PRIMARIES, TRANSFERS, Colour
from dubbing.media.properties.native import YUV420
from tests import clips

pytestmark = pytest.mark.medium


BARS = "smptebars=size=128x96:rate=25:duration=0.4"
WIDE = Colour("bt2020", "bt2020", "bt2020-10", False)


def write(path: Path, *options: str, bars: str = BARS) -> Path:
    clips.ffmpeg("-f", "lavfi", "-i", bars, *options, path)
    return path


def tagged(colour: Colour, pixels: str = "yuv420p") -> list[str]:
    level = "pc" if colour.full_range else "tv"
    change = f"scale=out_color_matrix={colour.matrix}:out_range={level},format={pixels},setparams="
    tags = ":".join(f"{key}={tag}" for key, tag in colour.tags().items())
    return ["-vf", change + tags, "-c:v", "libx264", "-crf", "4"]


SD = Colour("bt601", "smpte170m", "smpte170m", False)
FULL = Colour("bt709", "bt709", "bt709", True)


@pytest.mark.parametrize("colour", [Colour(), SD, WIDE, FULL], ids=str)
@pytest.mark.parametrize("codec", ["h264", "prores", "ffv1"])
def test_colours_are_carried_over(tmp_path: Path, codec: str, colour: Colour) -> None:
    source = write(tmp_path / "source.mp4", *tagged(colour))
    info = media.probe(source)
    assert info.colour == colour
    made = tmp_path / f"made{media.SUFFIX[codec]}"
    frames = list(media.read_frames(source))
    with media.VideoWriter(tmp_path / "a.mov", 128, 96, Fraction(25), codec, info.colour) as video:
        for frame in frames:
            video.write(frame)
    sound = clips.write_sound(tmp_path / "a.wav", 0.4)
    parts = [(tmp_path / "a.mov", Fraction(10, 25))]
    media.mux(parts, sound, made, audio_start=0, seconds=0.4, timecode="01:00:00:05")
    found = media.probe(made)
    assert found.timecode == "01:00:00:05"
    assert found.colour.primaries == colour.primaries
    assert found.colour.transfer == colour.transfer
    if codec != "ffv1":  # RGB has no matrix
        assert found.colour.matrix == colour.matrix
    assert found.colour.full_range == (colour.full_range and codec == "h264")
    again = np.stack([*media.read_frames(made)]).astype(int)
    difference = np.abs(again - np.stack(frames))
    assert np.median(difference) <= 1
    assert difference.mean() < (0.01 if codec == "ffv1" else 3)


def test_a_proxy_looks_the_same(tmp_path: Path) -> None:
    source = write(tmp_path / "a.mov", "-c:v", "prores_ks", "-pix_fmt", "yuv422p10le")
    sound = clips.write_sound(tmp_path / "a.wav", 0.4, channels=6)
    media.mux(source, sound, tmp_path / "b.mov", audio_start=0, seconds=0.4, audio_codec="pcm")
    media.proxy(tmp_path / "b.mov", tmp_path / "p.mp4", {"comment": "AI-generated"})
    info = media.probe(tmp_path / "p.mp4")
    assert (info.width, info.height, info.frames, info.audio_channels) == (128, 96, 10, 2)
    pictures = zip(
        media.read_frames(tmp_path / "b.mov"), media.read_frames(tmp_path / "p.mp4"), strict=True
    )
    assert max(np.abs(a.astype(int) - b).mean() for a, b in pictures) < 4


@pytest.mark.parametrize(
    ("timecode", "rate"), [("01:00:00:00", "25"), ("00:59:59;28", "30000/1001"), ("", "24")]
)
def test_timecode(tmp_path: Path, timecode: str, rate: str) -> None:
    bars = f"smptebars=size=128x96:rate={rate}:duration=0.4"
    options = ["-timecode", timecode] if timecode else []
    for suffix in (".mov", ".mp4", ".mkv"):
        path = write(tmp_path / f"a{suffix}", *options, "-c:v", "libx264", bars=bars)
        assert media.probe(path).timecode == timecode


def test_what_is_not_kept_is_seen(tmp_path: Path) -> None:
    hdr = write(
        tmp_path / "hdr.mp4", *tagged(Colour("bt2020", "bt2020", "smpte2084"), "yuv420p10le")
    )
    assert media.probe(hdr).colour.space == "Rec.2100-PQ - Display"
    assert media.probe(hdr).picture.pixels.bits == 10  # type: ignore[union-attr]
    fields = write(
        tmp_path / "i.mp4", "-c:v", "libx264", "-flags", "+ilme+ildct", "-x264-params", "tff=1",
        *("-vf", "interlace"),
    )  # fmt: skip
    assert is_flagged(fields)
    slim = write(tmp_path / "a.mp4", "-c:v", "libx264", "-vf", "setsar=4/3")
    assert not media.probe(slim).picture.square  # type: ignore[union-attr]


@pytest.mark.parametrize("codec", ["ffv1", "hevc"])
def test_every_tag_is_written_as_it_is_read(tmp_path: Path, codec: str) -> None:
    """A transfer of PAL had a name that ffmpeg does not know: the dub failed."""
    primaries, transfers = (list(names.values()) for names in (PRIMARIES, TRANSFERS))
    black = YUV420.black(64, 48, Colour())
    for one, other in itertools.zip_longest(primaries, transfers, fillvalue="bt709"):
        colour = Colour("bt709", one, other)
        path = tmp_path / f"{one}-{other}{media.SUFFIX[codec]}"
        with media.VideoWriter(path, 64, 48, Fraction(25), codec, colour, YUV420) as video:
            video.write(black)
        assert media.probe(path).colour == colour


@pytest.mark.parametrize(
    ("tag", "words"),
    [
        ("matrix_coefficients=8", "YCgCo, which cannot be read"),
        ("matrix_coefficients=10", "BT.2020 of constant luminance"),
        ("transfer_characteristics=9", "a logarithmic transfer"),
    ],
)
def test_colours_that_cannot_be_read_are_refused(tmp_path: Path, tag: str, words: str) -> None:
    plain, path = write(tmp_path / "a.mp4", *tagged(Colour())), tmp_path / "b.mp4"
    clips.ffmpeg("-i", plain, "-c", "copy", "-bsf:v", f"h264_metadata={tag}", path)
    with pytest.raises(MediaError, match=words):
        media.probe(path)


@pytest.mark.parametrize(
    ("size", "tags", "primaries"),
    [
        ("720x576", (), "bt470bg"),
        ("720x480", (), "smpte170m"),
        ("1280x720", (), "bt709"),
        ("64x48", ("-bsf:v", "h264_metadata=matrix_coefficients=5"), "bt470bg"),
        ("720x576", ("-bsf:v", "h264_metadata=colour_primaries=6"), "smpte170m"),
    ],
)
def test_primaries_that_no_tag_names(
    tmp_path: Path, size: str, tags: tuple[str, ...], primaries: str
) -> None:
    bars = f"testsrc2=size={size}:rate=25:duration=0.04"
    plain = write(tmp_path / "a.mp4", "-c:v", "libx264", "-pix_fmt", "yuv420p", bars=bars)
    clips.ffmpeg("-i", plain, "-c", "copy", *tags, tmp_path / "b.mp4")
    assert media.probe(tmp_path / "b.mp4").colour.primaries == primaries
