"""Films of numbered files: their rate, timecode, gaps, colours; the values that come back."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing import packages
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.numbered import numbered, plain, with_options
from dubbing.errors import ExplainedError, MediaError
from dubbing.media import probe, read_frames, read_planes
from dubbing.media.properties import film_values
from dubbing.media.properties.film_values import FilmValues
from dubbing.media.sequences import image_files, sequence
from tests import sequences

GREY = np.full((48, 64, 3), 0.18, np.float16)
WHITE = np.full((48, 64, 3), 65535, np.uint16)


def film(folder: Path, name: str = "shot.####.exr", **tags: Any) -> Path:
    values = GREY if name.endswith("exr") else WHITE // 2
    return sequences.write_sequence(folder / name, [values] * 3, **tags)


@pytest.mark.parametrize(
    ("name", "tags", "rate", "timecode"),
    [
        ("s.####.exr", {"rate": "24000/1001", "timecode": 0x01020304}, "24000/1001", "01:02:03:04"),
        ("s.####.exr", {"rate": "25"}, "25", "00:00:40:01"),
        ("s_####.dpx", {"dpx__FrameRate": 23.976}, "24000/1001", "00:00:41:17"),
        ("s_####.dpx", {"dpx__FrameRate": 30.0, "timecode": 0x10000000}, "30", "10:00:00:00"),
    ],
)
def test_rate_and_timecode(
    tmp_path: Path, name: str, tags: dict[str, Any], rate: str, timecode: str
) -> None:
    info = probe(film(tmp_path, name, **tags))
    assert (info.rate, info.timecode, info.frames) == (Fraction(rate), timecode, 3)
    assert (info.width, info.height, info.audio_rate) == (64, 48, None)


def test_a_name_as_printf_writes_it_is_the_same_film(tmp_path: Path) -> None:
    film(tmp_path, rate=24)
    assert probe(tmp_path / "shot.%04d.exr").frames == 3
    assert plain(with_options(tmp_path / "shot.%04d.exr", {"rate": "24"})).name == "shot.####.exr"


def test_the_given_rate_counts_before_that_of_the_files(tmp_path: Path) -> None:
    path = with_options(film(tmp_path, rate=24), {"rate": "30000/1001"})
    assert probe(path).rate == Fraction(30000, 1001)


@pytest.mark.parametrize(
    ("name", "tags", "words"),
    [
        ("s.####.tif", {}, "no frame rate"),
        ("s.####.exr", {"rate": 24, "PixelAspectRatio": 2.0}, "not square"),
        ("s.####.dpx", {"dpx__FrameRate": 24.0, "dpx__Transfer": "Logarithmic"}, "logarithmic"),
        ("s.####.exr", {"rate": 24, "chromaticities": (0.6,) * 8}, "no colour space"),
    ],
)
def test_what_is_refused(tmp_path: Path, name: str, tags: dict[str, Any], words: str) -> None:
    with pytest.raises(MediaError, match=words):
        probe(film(tmp_path, name, **tags))


def test_missing_frames_are_named_at_once(tmp_path: Path) -> None:
    path = sequences.write_sequence(tmp_path / "s.####.exr", [GREY] * 8, rate=24)
    for number in (1002, 1004, 1005):
        (tmp_path / f"s.{number}.exr").unlink()
    with pytest.raises(MediaError, match=r"frames are missing: 1002, 1004-1005"):
        probe(path)


def test_a_frame_of_another_size_is_named(tmp_path: Path) -> None:
    path = film(tmp_path, rate=24)
    sequences.write_image(tmp_path / "shot.1002.exr", GREY[:32])
    with pytest.raises(MediaError, match=r"64x32 px, not 64x48.*shot.1002.exr"):
        list(read_frames(path))


def test_a_damaged_frame_is_named(tmp_path: Path) -> None:
    path = film(tmp_path, rate=24)
    (tmp_path / "shot.1002.exr").write_bytes(b"#EXTM3U\nhttp://example.com/a.ts\n")
    with pytest.raises(MediaError, match=r"shot\.1002\.exr"):
        list(read_frames(path))


def test_any_changed_frame_changes_the_digest(tmp_path: Path) -> None:
    path = film(tmp_path, rate=24)
    before = digest_of(path)
    assert before != digest_of(with_options(path, {"film": "ACEScg"}))
    sequences.write_image(tmp_path / "shot.1002.exr", GREY * 2, rate=24)
    assert digest_of(path) not in ("", before)


@pytest.mark.parametrize(
    ("tags", "options", "wanted"),
    [
        ({}, {}, "Linear Rec.709 (sRGB)"),
        ({"chromaticities": sequence.CHROMATICITIES["lin_ap0_scene"]}, {}, "ACES2065-1"),
        ({"colorInteropID": "lin_ap1_scene"}, {}, "ACEScg"),
        ({"colorInteropID": "lin_ap1_scene"}, {"film": "LogC4"}, "ARRI LogC4"),
    ],
)
def test_colours_are_those_that_are_given_or_tagged(
    tmp_path: Path, tags: dict[str, Any], options: dict[str, str], wanted: str
) -> None:
    path = film(tmp_path, rate=24, **tags)
    assert probe(with_options(path, options)).values.film == wanted


@pytest.mark.parametrize(("name", "words"), [("nope", "has no such"), ("S-Log3", "several")])
def test_a_colour_space_that_is_not_known(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(MediaError, match=rf"{words}.*choose of: .*S-Log3 S-Gamut3"):
        probe(with_options(film(tmp_path, rate=24), {"film": name}))


def test_a_display_shows_grey_as_it_should(tmp_path: Path) -> None:
    (picture, *_) = read_frames(film(tmp_path, rate=24))
    assert tuple(picture[0, 0]) == (118, 118, 118)  # 18 % of light, as sRGB encodes it
    (green, *_), *_ = read_planes(tmp_path / "shot.####.exr")
    assert green[0, 0] == 118


SPACES = (
    *("Linear Rec.709 (sRGB)", "ACEScg", "ACES2065-1", "ARRI LogC3 (EI800)", "ARRI LogC4"),
    *("S-Log3 S-Gamut3", "V-Log V-Gamut", "Log3G10 REDWideGamutRGB", "Rec.2100-PQ - Display"),
    "",
)


def ramp(space: str) -> np.ndarray:
    """Greys (1, N, 3) from black to 1,000 nits, as a film of half floats holds them."""
    most = 10.0 if space.startswith(("Linear", "ACES")) else 0.75
    values = np.linspace(0, most, 4096).astype(np.float16).astype(np.float32)
    return np.repeat(values[None, :, None], 3, 2)


@pytest.mark.parametrize("space", SPACES)
def test_a_grey_ramp_comes_back(space: str) -> None:
    """Through the display and back; and where each pixel is changed by as little as can be."""
    film, values = ramp(space), FilmValues(space)
    step = np.maximum(np.spacing(film.astype(np.float16)).astype(np.float32), 1e-6)
    assert (np.abs(values.of_display(values.display(film)) - film) <= step).all()
    shown = values.picture(film)
    assert np.array_equal(values.changed(film, shown, shown), film)


@pytest.mark.parametrize("space", SPACES)
def test_highlights_have_no_seam(space: str) -> None:
    """One step less of 255 is one step of 255 less for a display, at 1,000 nits as in a grey."""
    film, values = ramp(space), FilmValues(space)
    shown = values.picture(film)
    darker = np.where(shown > 0, shown - np.minimum(shown, 1), shown)
    made = values.display(values.changed(film, shown, darker))
    apart = values.display(film) - made
    beyond = np.maximum(values.display(film) - 1, 0)
    assert (apart[shown > 1] > 0).all()
    assert (apart <= 1.01 / 255 + 0.04 * beyond).all()
    assert (np.diff(made[0, :, 0][shown[0, :, 0] > 0]) > -1e-3).all()


def test_a_dark_mouth_takes_the_place_of_a_highlight() -> None:
    values = FilmValues("Linear Rec.709 (sRGB)")
    film = np.full((1, 1, 3), 10, np.float32)
    made = values.changed(film, np.full((1, 1, 3), 255, np.uint8), np.full((1, 1, 3), 30, np.uint8))
    assert made.max() < 0.02


def test_integers_are_written_as_they_were(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    ten = rng.integers(0, 1024, (16, 16, 3))
    stored = ((ten << 6) | (ten >> 4)).astype(np.uint16)
    path = sequences.write_image(tmp_path / "a.1.dpx", stored, oiio__BitsPerSample=10)
    image = image_files.read_image(path)
    differs = np.zeros((16, 16), bool)
    differs[3, 4] = True
    made = image.with_values(image.values() * 0, differs)
    image_files.write_image(tmp_path / "b.1.dpx", made, image.header)
    again = image_files.read_image(tmp_path / "b.1.dpx").stored
    assert not again[3, 4].any()
    assert np.array_equal(again[~differs], stored[~differs])


@pytest.mark.parametrize("name", ["OpenImageIO", "PyOpenColorIO"])
def test_a_missing_library_is_named_with_its_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = film(tmp_path, rate=24)
    film_values.spaces.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, name, None)
    monkeypatch.setattr(packages, "declared", lambda extra="": {})
    with pytest.raises(ExplainedError, match=f"not installed: {name}"):
        probe(path)


def test_other_names_are_files() -> None:
    for name in ("clip.mp4", "shot.1001.exr", "take#2.mov", "50%.exr"):
        assert numbered(Path(name)) is None
