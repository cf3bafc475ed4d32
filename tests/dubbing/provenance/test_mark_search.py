"""The mark is found after what happens to videos, and is not found where it is not."""

from pathlib import Path

import numpy as np
import pytest
from scipy import fft, stats

from dubbing import media
from dubbing.provenance import mark_search
from dubbing.provenance.mark import BITS, TILE, Code
from dubbing.provenance.mark_key import id_of
from dubbing.provenance.mark_search import Found
from tests.dubbing.provenance import film

COUNT = 16
CROP = "crop=576:432:20:30"  # a tenth off either side


def found(path: Path, key: bytes = film.KEY) -> Found:
    return mark_search.search(*mark_search.summed(media.read_frames(path, pixels="gray")), key)


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film")
    return film.write(folder / "dub.mp4", film.marked(film.frames(COUNT)))


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("-crf", "28"),
        ("-vf", "scale=-2:360", "-crf", "23"),
        ("-vf", CROP, "-crf", "23"),
        ("-vf", f"{CROP},scale=-2:360", "-crf", "23"),
        ("-c", "copy"),
    ],
    ids=["as made", "crf 28", "smaller", "cropped", "cropped and smaller", "second mux"],
)
def test_it_is_found_with_all_its_bits(marked: Path, options: tuple[str, ...]) -> None:
    seen = found(film.treated(marked, *options) if options else marked)
    assert seen.present
    assert id_of(seen.bits) == film.ID
    assert seen.frames == COUNT


def test_another_key_finds_nothing(marked: Path) -> None:
    seen = found(marked, b"another key of so many bytes....")
    assert not seen.present


def test_nothing_is_found_where_nothing_is(tmp_path: Path) -> None:
    seen = found(film.write(tmp_path / "plain.mp4", film.frames(COUNT)))
    assert not seen.present
    assert seen.statistic < 0.85 * seen.threshold


def test_the_threshold_is_a_bound_of_chi_squared() -> None:
    for chance in (1e-6, 1e-12):
        limit = mark_search.threshold(chance)
        assert stats.chi2.sf(limit, BITS) < chance
        assert stats.chi2.sf(limit, BITS) > chance / 1000


def test_false_alarms_are_as_rare_as_is_reported() -> None:
    """S of many keys at every shift of an unmarked film has the tail of chi squared at most."""
    total, _ = mark_search.summed(frame[..., 1] for frame in film.frames(4))
    folded = mark_search.fold(total, 1.0, (0.0, 0.0, 1.0))[0, 0]
    spectrum, square = fft.rfft2(folded), fft.rfft2(folded**2)
    values = []
    for number in range(60):
        code = Code.of(number.to_bytes(32, "big"))
        own = code.owners == np.arange(BITS)[:, None, None]
        sums = fft.irfft2(spectrum * mark_search.templates(code), s=(TILE, TILE))
        squares = fft.irfft2(square * np.conj(fft.rfft2(own.astype(float))), s=(TILE, TILE))
        values.append(np.sum(sums**2 / squares, axis=0).ravel())
    every = np.concatenate(values)
    assert every.mean() == pytest.approx(BITS, rel=0.02)
    for chance in (1e-2, 1e-3, 1e-4):
        assert (every > stats.chi2.isf(chance, BITS)).mean() < 1.5 * chance
    assert every.max() < mark_search.threshold(1e-6)


def test_pictures_without_any_content_are_no_mistake() -> None:
    for picture in (np.zeros((480, 640), np.uint8), np.full((2, 2), 7, np.uint8)):
        seen = mark_search.search(*mark_search.summed([picture] * 2), film.KEY)
        assert not seen.present
    assert not mark_search.search(*mark_search.summed([]), film.KEY).present
