"""Films in HDR and camera log through the whole video: greys, highlights, and what is shown."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.engine.disk.numbered import options_of, with_options
from dubbing.media.properties.colour import Colour
from dubbing.media.properties.film_values import FilmValues
from dubbing.media.properties.native import PixelFormat
from dubbing.mixing.sound import Sound
from dubbing.preparation.prepared import MATTE
from dubbing.script.timeline import Cue
from dubbing.video.assembly import make
from dubbing.video.files import PROXY_FILE
from dubbing.video.heads import Heads, read_heads
from dubbing.video.own_pixels import reasons, views
from dubbing.video.settings import VideoSettings
from tests import clips, fakes

pytestmark = pytest.mark.medium

FRAMES, SIZE, WINDOW, CROP = 4, (512, 128), (384, 0, 128), 128
DEEP = PixelFormat("yuv444p10le", 10)
COLOURS: dict[str, tuple[Colour, dict[str, str]]] = {
    "PQ": (Colour("bt2020", "bt2020", "smpte2084"), {}),
    "HLG": (Colour("bt2020", "bt2020", "arib-std-b67"), {}),
    "LogC4": (Colour(), {"film": "LogC4"}),
    "S-Log3": (Colour(), {"film": "S-Log3 S-Gamut3.Cine"}),
}
BRIGHT = 1.98  # of a display, 1,000 cd/m2 where white has 203


def film(folder: Path, name: str, luma: np.ndarray) -> Path:
    """A grey film (H, W) of code values."""
    colour, options = COLOURS[name]
    path, rate = folder / "film.mkv", Fraction(25)
    planes = [luma.astype("<u2"), *[np.full(luma.shape, 512, "<u2")] * 2]
    with media.VideoWriter(path, *SIZE, rate, "ffv1", colour, DEEP) as writer:
        for _ in range(FRAMES):
            writer.write(planes)
    return with_options(path, options)


def level(name: str, shown: float) -> np.ndarray:
    """Code values (H, W) of which a display shows one grey."""
    colour, options = COLOURS[name]
    grey = np.full((1, 1, 3), shown, np.float32)
    value = FilmValues.of(options, colour.space).of_display(grey)[0, 0, 1]
    return np.full(SIZE[::-1], round(64 + 876 * float(value)))


def dubbed(folder: Path, clip: Path, codec: str, head: np.ndarray | None = None) -> Path:
    """Its dub with a head (S, S, 4) in all frames, or with fake ones."""
    prepared = fakes.write_prepared(clip, folder / "prepared", window=WINDOW, size=CROP)
    if head is None:
        fakes.write_heads(folder / "heads", FRAMES, prepared.rate, CROP)
    else:  # it fills the crop
        for file, kind, picture in (
            (folder / "heads" / "000000.mkv", "ffv1-rgba", head),
            (prepared.folder / MATTE, "ffv1-gray", head[..., 3]),
        ):
            with media.VideoWriter(file, CROP, CROP, prepared.rate, kind) as writer:
                for _ in range(FRAMES):
                    writer.write(picture)
    seconds = float(FRAMES / prepared.rate)
    audio = clips.write_sound(folder / "a.wav", seconds + 0.1, 48000)
    kept = reasons(prepared, views(prepared))
    return make(
        [Heads(partial(read_heads, folder / "heads"), prepared, 0, FRAMES, kept)],
        Sound((Cue("it", 0, FRAMES, audio, 0.0, seconds),)),
        folder / "out",
        pose_index=np.arange(FRAMES),
        settings=VideoSettings(codec=codec, label=False),
        progress=lambda _message, _share: None,
    )


@pytest.mark.parametrize("codec", ["ffv1", "hevc", "prores4444"])
@pytest.mark.parametrize("name", COLOURS)
def test_a_grey_ramp_comes_back(tmp_path: Path, name: str, codec: str) -> None:
    ramp = np.tile(np.linspace(64, 940, SIZE[0]).round(), (SIZE[1], 1))
    clip = film(tmp_path, name, ramp)
    result = dubbed(tmp_path, clip, codec)
    (luma, *chroma), *_ = media.read_planes(result, pixels=DEEP)
    outside = np.s_[:, : WINDOW[0] - 16]
    most = 0 if codec == "ffv1" else 1
    assert np.abs(luma[outside].astype(int) - ramp[outside]).max() <= most
    assert all(np.abs(plane[outside].astype(int) - 512).max() <= most for plane in chroma)
    left, top, side = WINDOW
    shown = next(media.read_frames(with_options(result, options_of(clip))))
    head = shown[top + side // 2, left + side // 2].astype(int)
    assert np.abs(head - (*fakes.HEAD[:2], 0)).max() <= (2 if codec == "ffv1" else 8)


@pytest.mark.parametrize("name", COLOURS)
def test_a_face_on_a_bright_patch_has_no_seam(tmp_path: Path, name: str) -> None:
    """A head that is a little darker in its middle, over what is five times as bright as white."""
    clip = film(tmp_path, name, level(name, BRIGHT))
    values = media.probe(clip).values
    here = np.linspace(-1, 1, CROP)
    apart = np.clip(1 - np.hypot(here, here[:, None]) / 0.7, 0, 1)
    head = np.full((CROP, CROP, 4), 255, np.uint8)
    head[..., :3] = (255 - 45 * apart).round().astype(np.uint8)[..., None]
    result = dubbed(tmp_path, clip, "ffv1", head)
    (luma, *_), *_ = media.read_planes(result)
    grey = (luma.astype(np.float32) - 64) / 876
    shown = values.display(np.repeat(grey[..., None], 3, 2))[..., 0]
    assert abs(shown.max() - BRIGHT) < 0.01
    assert shown.max() - shown.min() > 0.2
    steps = max(np.abs(np.diff(shown, axis=axis)).max() for axis in (0, 1))
    assert steps < 0.2  # from 1.98 to 1, where highlights end


@pytest.mark.parametrize("name", COLOURS)
def test_what_becomes_white_beside_a_highlight_is_as_bright(name: str) -> None:
    """A collar comes out behind a jaw: its picture is white, the film's is five times as bright."""
    colour, options = COLOURS[name]
    values = FilmValues.of(options, colour.space)
    shown = np.full((90, 160, 3), 0.4, np.float32)
    shown[:, :40] = BRIGHT
    film = values.of_display(shown)
    before = values.picture(film)
    after = before.copy()
    after[10:30, 40:50] = 255  # the collar goes on
    after[10:30, 50:60] = 90  # beside it is skin
    after[10:30, 100:110] = 255  # a tooth, far from it
    made = values.display(values.changed(film, before, after))[20]
    assert np.abs(made[40:50] - BRIGHT).max() < 0.1
    assert np.abs(made[50:60] - 90 / 255).max() < 0.01
    assert np.abs(made[100:110] - 1).max() < 0.01


def test_the_proxy_is_what_a_display_shows(tmp_path: Path) -> None:
    dubbed(tmp_path, film(tmp_path, "LogC4", level("LogC4", 0.5)), "prores4444")
    proxy = tmp_path / "out" / PROXY_FILE
    assert media.probe(proxy).values.film == ""
    assert media.probe(proxy).audio_rate
    picture, *_ = media.read_frames(proxy)
    assert np.abs(picture[:, :40].astype(int) - 128).max() <= 4


def test_white_of_hdr_is_white(tmp_path: Path) -> None:
    for name, white in (("PQ", 0.5806), ("HLG", 0.75)):  # 203 cd/m2
        clip = film(tmp_path, name, np.full(SIZE[::-1], round(64 + 876 * white)))
        picture = next(media.read_frames(clip))
        assert picture.min() >= 254 - 1
        darker = film(tmp_path, name, np.full(SIZE[::-1], round(64 + 876 * (white - 0.02))))
        assert next(media.read_frames(darker)).max() < 250
