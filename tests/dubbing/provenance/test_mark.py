from fractions import Fraction

import cv2
import numpy as np
import pytest
from skimage.color import deltaE_ciede2000, rgb2lab

from dubbing.provenance.mark import BITS, CELLS, PERIOD, TILE, WAVE, Code, Mark, masked_by, wave
from dubbing.provenance.mark_key import bits_of
from tests.dubbing.provenance import film

SIGNS = [-1.0, 1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0]
OWNERS = [53, 31, 31, 12, 31, 32, 52, 9]
CELL = min(film.SIZE) / CELLS
# Pictures that hide little: plain walls from black to white, a shaded cheek, a sharp edge.
EVEN = {f"wall of {grey}": np.full((240, 240), float(grey)) for grey in (0, 20, 60, 128, 200, 250)}
SHADED = 120 + 60 * np.cos(np.linspace(-1.2, 1.2, 240))[:, None] * np.ones(240)
EDGE = np.where(np.arange(240) < 120, 90.0, 180.0) * np.ones((240, 1))


def as_seen(picture: np.ndarray) -> np.ndarray:
    """CIELAB of an RGB picture as an eye sees it at 60 px a degree, after S-CIELAB."""
    lab = rgb2lab(picture)
    blurred = [cv2.GaussianBlur(lab[..., k], (0, 0), sigma) for k, sigma in enumerate((1.2, 4, 6))]
    return np.stack(blurred, -1)


@pytest.mark.parametrize("grey", [*EVEN.values(), SHADED, EDGE], ids=[*EVEN, "cheek", "edge"])
def test_nobody_sees_it_on_a_smooth_picture(grey: np.ndarray) -> None:
    """By another model than the one that shapes it: half of what is just noticeable, at most."""
    plain = np.repeat(grey.round().astype(np.uint8)[..., None], 3, 2)
    mark = Mark(film.KEY, bits_of(film.ID), 240, 240, film.RATE)
    all_of_it = np.full((240, 240), 255, np.uint8)
    frames = [mark.draw(plain, all_of_it, k).astype(float) for k in range(28)]
    for made, most in ((frames[0], 0.5), (np.mean(frames, 0), 0.35)):  # still, and moving
        away = deltaE_ciede2000(as_seen(made / 255), as_seen(plain / 255.0))
        assert np.percentile(away, 99) < most
    assert np.abs(frames[0] - plain).max() <= 3


def test_rough_and_dark_parts_hide_more_and_an_edge_does_not() -> None:
    rng = np.random.default_rng(0)
    smooth = np.full((120, 120, 3), 128, np.uint8)
    rough = (smooth + rng.normal(0, 12, (120, 120, 1))).round().astype(np.uint8)
    dark = np.full_like(smooth, 10)
    middle = (slice(40, 80), slice(40, 80))
    levels = {
        name: float(masked_by(picture, CELL)[middle].mean())
        for name, picture in (("smooth", smooth), ("rough", rough), ("dark", dark))
    }
    assert levels["smooth"] == pytest.approx(0.7)
    assert levels["rough"] > 1.3 * levels["smooth"]
    assert levels["dark"] > 1.5 * levels["smooth"]
    beside = np.concatenate([smooth, np.full_like(smooth, 170)], 1)
    assert masked_by(beside, CELL)[middle[0], 110:130].max() < 0.9


def test_only_replaced_pixels_bear_it() -> None:
    (plain,) = film.frames(1)
    mark = Mark(film.KEY, bits_of(film.ID), *film.SIZE, film.RATE)
    replaced = np.zeros(plain.shape[:2], np.uint8)
    replaced[100:200, 300:420], replaced[150, 500] = 255, 1
    changed = (mark.draw(plain, replaced, 0) != plain).any(-1)
    assert not changed[replaced == 0].any()
    assert changed[100:200, 300:420].mean() > 0.3
    np.testing.assert_array_equal(mark.draw(plain, replaced * 0, 0), plain)


def test_it_is_turned_round_by_a_wave_that_resembles_no_shift_of_itself() -> None:
    (plain,) = film.frames(1)
    mark = Mark(film.KEY, bits_of(film.ID), *film.SIZE, film.RATE)
    replaced = np.full(plain.shape[:2], 255, np.uint8)
    shown = [mark.draw(plain, replaced, k)[..., 1].astype(int) - plain[..., 1] for k in range(14)]
    alike = [np.corrcoef(shown[0].ravel(), s.ravel())[0, 1] for s in shown]
    assert np.sign(alike).tolist() == np.repeat(WAVE, 2).tolist()
    assert np.min(np.abs(alike)) > 0.3
    assert [wave(k / film.RATE) for k in range(0, 28, 2)] == [*WAVE, *WAVE]
    assert wave(Fraction(1, 10)) == wave(Fraction(1, 10) + PERIOD)
    assert {int(np.dot(WAVE, np.roll(WAVE, k))) for k in range(1, len(WAVE))} == {-1}


def test_every_bit_has_as_many_cells_and_the_key_decides_which() -> None:
    one, other = Code.of(b"a" * 32), Code.of(b"b" * 32)
    assert set(np.bincount(one.owners.ravel())) == {TILE * TILE // BITS}
    assert abs(float(one.signs.mean())) < 0.06
    assert (one.signs != other.signs).mean() == pytest.approx(0.5, abs=0.05)


def test_the_pattern_of_a_key_stays_what_it_is() -> None:
    """Marks that were drawn by another version are to be found, too."""
    code = Code.of(film.KEY)
    assert code.signs[0, :8].tolist() == SIGNS
    assert code.owners[0, :8].tolist() == OWNERS
