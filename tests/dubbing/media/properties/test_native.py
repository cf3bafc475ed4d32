"""A film's own values: read as they are, changed where its picture was, and written again."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from dubbing import media
from dubbing.errors import MediaError
from dubbing.media.properties.colour import Colour
from dubbing.media.properties.native import PixelFormat, pooled
from tests import clips

pytestmark = pytest.mark.medium

RATE = Fraction(25)
SIZE = 70, 50
FILMS = {  # format: bits, planes
    "yuv420p": (8, 3),
    "yuv420p10le": (10, 3),
    "yuv422p": (8, 3),
    "yuv422p10le": (10, 3),
    "yuv444p12le": (12, 3),
    "yuv411p": (8, 3),
    "gray": (8, 1),
    "bgr0": (8, 3),
    "gbrp12le": (12, 3),
    "gbrp16le": (16, 3),
}


def picture(width: int = SIZE[0], height: int = SIZE[1]) -> np.ndarray:
    """Colours that change slowly, so that chroma of fewer values shows them."""
    down, across = np.mgrid[:height, :width].astype(np.float64)
    waves = (across / width, down / height, 0.5 + 0.5 * np.cos(across / width * 3 + down / height))
    return np.asarray((30 + 180 * np.stack(waves, -1)).round(), np.uint8)


def film(path: Path, pixels: str, *, full: bool = False, size: tuple[int, int] = SIZE) -> Path:
    """A lossless film of three frames of the picture."""
    rgb = path.with_name("rgb.mkv")
    with media.VideoWriter(rgb, *size, RATE, "ffv1") as writer:
        for _ in range(3):
            writer.write(picture(*size))
    scale = f"scale=out_color_matrix=bt709:out_range={'pc' if full else 'tv'}"
    tags = ["-colorspace", "bt709", "-color_range", "pc" if full else "tv"]
    grey = pixels.startswith("gray")
    filters = [] if pixels in ("bgr0",) or pixels.startswith("gbrp") else ["-vf", scale]
    clips.ffmpeg(
        "-i", rgb, *filters, "-c:v", "ffv1", "-pix_fmt", pixels, *([] if grey else tags), path
    )
    return path


@pytest.mark.parametrize("pixels", FILMS)
def test_planes_are_the_values_that_are_stored(tmp_path: Path, pixels: str) -> None:
    path = film(tmp_path / "film.mkv", pixels)
    info = media.probe(path)
    assert (info.pixels.bits, info.pixels.count) == FILMS[pixels]
    with av.open(path) as container:
        stored = next(container.decode(video=0))
    planes = next(media.read_planes(path))
    if pixels == "bgr0":
        green_blue_red = stored.to_ndarray(format="rgb24")[..., [1, 2, 0]]
        np.testing.assert_array_equal(np.stack(planes, -1), green_blue_red)
        return
    for plane, own in zip(planes, stored.planes, strict=True):
        width = own.line_size // info.pixels.kind.itemsize
        values = np.frombuffer(memoryview(own), info.pixels.kind).reshape(own.height, width)
        np.testing.assert_array_equal(plane, values[:, : own.width])


@pytest.mark.parametrize(
    ("given", "planar"),
    [
        ("nv12", "yuv420p"),
        ("yuvj420p", "yuv420p"),
        ("p010le", "yuv420p10le"),
        ("uyvy422", "yuv422p"),
        ("rgb24", "gbrp"),
        ("bgra", "gbrp"),
        ("pal8", "gbrp"),
        ("rgb48le", "gbrp16le"),
        ("xyz12le", "gbrp12le"),
        ("gbrpf32le", "gbrp16le"),
        ("yuva444p10le", "yuv444p10le"),
        ("ya8", "gray"),
    ],
)
def test_packed_and_transparent_pixels_have_a_planar_format(given: str, planar: str) -> None:
    assert PixelFormat.holding(given).name == planar


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("pixels", FILMS)
def test_what_changes_in_the_picture_changes_in_the_planes(
    tmp_path: Path, pixels: str, full: bool
) -> None:
    path = film(tmp_path / "film.mkv", pixels, full=full)
    info = media.probe(path)
    (before, *_), (planes, *_) = media.read_frames(path), media.read_planes(path)
    after = before.copy()
    after[13:37, 21:45] = (after[13:37, 21:45] * 0.5 + [60, 20, 40]).round()
    made = info.pixels.changed(planes, before, after, info.colour)
    assert made is not planes
    assert info.pixels.changed(planes, before, before, info.colour) is planes
    out = tmp_path / "out.mkv"
    with media.VideoWriter(out, *SIZE, RATE, "ffv1", info.colour, info.pixels) as writer:
        writer.write(made)
    (shown,) = media.read_frames(out)
    # Planes of fewer values change in whole ones; the decoder spreads those to their neighbours.
    inner, outer = (slice(17, 33), slice(25, 41)), np.ones(SIZE[::-1], bool)
    outer[9:41, 13:53] = False
    wanted = after if pixels != "gray" else np.repeat(luma(after)[..., None], 3, 2)
    apart = np.abs(shown[inner].astype(float) - wanted[inner])
    assert apart.mean() < 1.3
    assert apart.max() < 8
    np.testing.assert_array_equal(shown[outer], before[outer])
    (again,) = media.read_planes(out)
    for plane, own in zip(again, made, strict=True):
        np.testing.assert_array_equal(plane, own)


def luma(image: np.ndarray) -> np.ndarray:
    """As of a small picture without tags."""
    return np.asarray(image.astype(float) @ [0.299, 0.587, 0.114])


def test_finer_steps_of_a_film_stay_below_what_is_blended() -> None:
    """A value of 10 bits keeps its last two bits where half of a pixel is replaced."""
    pixels = PixelFormat.holding("yuv444p10le")
    planes = [np.array([[500, 501, 502, 503]], np.uint16) for _ in range(3)]
    before = np.full((1, 4, 3), 100, np.uint8)
    made = pixels.changed(planes, before, before + 10, Colour())
    assert (np.diff(made[0].astype(int)) == 1).all()
    assert made[0][0, 0] - 500 == round(10 * 219 * 4 / 255)
    np.testing.assert_array_equal(made[1], planes[1])  # a grey change has no chroma


def test_chroma_at_a_cut_edge_is_the_mean_of_what_is_there() -> None:
    values = np.arange(15.0).reshape(3, 5)
    np.testing.assert_array_equal(pooled(values, 0, 0), values)
    assert pooled(values, 1, 1).tolist() == [[3, 5, 6.5], [10.5, 12.5, 14]]


@pytest.mark.parametrize(
    ("codec", "pixels", "there"),
    [
        ("h264", "yuv420p", "yuv420p"),
        ("h264", "yuv420p10le", "yuv420p"),
        ("hevc", "yuv422p10le", "yuv420p10le"),
        ("hevc", "yuv420p", "yuv420p"),
        ("prores", "yuv420p", "yuv422p10le"),
        ("prores", "gbrp16le", "yuv422p10le"),
        ("prores4444", "yuv444p12le", "yuv444p12le"),
        ("dnxhr", "yuv422p10le", "yuv422p10le"),
        ("ffv1", "gbrp16le", "gbrp16le"),
    ],
)
def test_every_codec_writes_the_depth_it_has(
    tmp_path: Path, codec: str, pixels: str, there: str
) -> None:
    size = (256, 144)  # DNxHR has nothing below
    path = film(tmp_path / "film.mkv", pixels, full=False, size=size)
    info = media.probe(path)
    out = tmp_path / f"out{media.SUFFIX[codec]}"
    with media.VideoWriter(out, *size, RATE, codec, info.colour, info.pixels) as writer:
        for planes in media.read_planes(path):
            writer.write(planes)
    with av.open(out) as container:
        assert next(container.decode(video=0)).format.name == there
    made = media.probe(out)
    assert made.frames == 3
    if not info.pixels.rgb:
        assert made.colour == info.colour
    for frame, own in zip(media.read_frames(out), media.read_frames(path), strict=True):
        assert np.abs(frame.astype(int) - own).mean() < 1.5


@pytest.mark.parametrize("pixels", ["yuv420p", "yuv420p10le"])
def test_odd_sides_are_made_even_without_a_change_inside(tmp_path: Path, pixels: str) -> None:
    path = film(tmp_path / "film.mkv", pixels, size=(71, 51))
    info, out = media.probe(path), tmp_path / "out.mp4"
    with media.VideoWriter(out, 71, 51, RATE, "h264", info.colour, info.pixels) as writer:
        for planes in media.read_planes(path):
            writer.write(planes)
    assert (media.probe(out).width, media.probe(out).height) == (72, 52)
    (frame, *_), (own, *_) = media.read_frames(out), media.read_frames(path)
    assert np.abs(frame[:51, :71].astype(int) - own).mean() < 2.5
    assert np.abs(frame[-1].astype(int) - frame[-2]).mean() < 4  # not black


def test_a_frame_of_another_shape_is_refused(tmp_path: Path) -> None:
    pixels = PixelFormat.holding("yuv420p10le")
    planes = pixels.black(64, 48, Colour())
    assert [int(p[0, 0]) for p in planes] == [64, 512, 512]

    def write(path: Path) -> None:
        with media.VideoWriter(path, 64, 48, RATE, "ffv1", Colour(), pixels) as writer:
            writer.write(planes)
            writer.write(np.zeros((48, 64, 3), np.uint8))

    with pytest.raises(MediaError, match=r"a frame is uint8\[48, 64, 3\], not uint16\[48, 64\], "):
        write(tmp_path / "a.mkv")
    assert not (tmp_path / "a.mkv").exists()
