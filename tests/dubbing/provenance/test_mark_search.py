"""The mark is found after what happens to videos, and is not found where it is not."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy import fft, stats

from dubbing import media
from dubbing.provenance import mark_match, mark_search, mark_sums
from dubbing.provenance.mark import BITS, TILE, Code
from dubbing.provenance.mark_key import bits_of, id_of
from dubbing.provenance.mark_search import MarkResult
from tests.dubbing.provenance import film

pytestmark = pytest.mark.medium


COUNT = 75
WANTED = bits_of(film.ID)
CROP = "crop=576:432:20:30"  # a tenth off either side


def found(path: Path, key: bytes = film.KEY, wanted: np.ndarray | None = None) -> MarkResult:
    frames, rate = media.read_frames(path, pixels="gray"), media.probe(path).rate
    (seen,) = mark_search.search(frames, rate, [key], wanted)
    return seen


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film")
    return film.write(folder / "dub.mp4", film.marked(film.frames(COUNT)))


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("-crf", "20"),
        ("-vf", "scale=-2:360", "-crf", "16"),
        ("-vf", CROP, "-crf", "16"),
        ("-c", "copy"),
        ("-ss", "0.44", "-crf", "16"),  # an encoder may begin within a period
        ("-r", "30", "-crf", "16"),
    ],
    ids=["as made", "crf 20", "smaller", "cropped", "second mux", "cut", "another rate"],
)
def test_it_is_found_with_all_its_bits(marked: Path, options: tuple[str, ...]) -> None:
    seen = found(film.treated(marked, *options) if options else marked)
    assert seen.present
    assert id_of(seen.bits) == film.ID


def test_a_search_ends_where_the_wanted_bits_are_read(marked: Path) -> None:
    first, other = found(marked, wanted=WANTED), found(marked, wanted=1 - WANTED)
    assert first.present
    assert id_of(first.bits) == id_of(other.bits) == film.ID
    assert (first.frames, other.frames) == (50, COUNT)


def test_a_frame_alone_shows_nothing(marked: Path) -> None:
    for frame in list(media.read_frames(marked, pixels="gray"))[::15]:
        (seen,) = mark_search.search([frame], film.RATE, [film.KEY], WANTED)
        assert not seen.present


def test_two_seconds_of_a_long_film_are_found() -> None:
    """As those of a line: before and after it nothing is marked."""
    (still,) = film.frames(1)
    plain = [np.roll(still, k % 40, 0) for k in range(150)]
    lines = film.marked(plain[50:100])
    frames = [cv2.cvtColor(f, cv2.COLOR_RGB2GRAY) for f in [*plain[:50], *lines, *plain]]
    seen, other = mark_search.search(frames, film.RATE, [film.KEY, b"o" * 32], WANTED)
    assert seen.present
    assert id_of(seen.bits) == film.ID
    assert seen.frames == len(frames)
    assert not other.present


def test_another_key_finds_nothing(marked: Path) -> None:
    seen = found(marked, b"another key of so many bytes....", WANTED)
    assert not seen.present


def test_nothing_is_found_where_nothing_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    some = mark_match.candidates()[::6]  # every sixth: all of them take a minute
    monkeypatch.setattr(mark_search, "candidates", lambda: some)
    seen = found(film.write(tmp_path / "plain.mp4", film.frames(30)))
    assert not seen.present
    assert seen.statistic < 0.9 * seen.threshold


def test_the_threshold_is_a_bound_of_chi_squared() -> None:
    for chance in (1e-6, 1e-12):
        limit = mark_search.threshold(chance)
        assert stats.chi2.sf(limit, BITS) < chance
        assert stats.chi2.sf(limit, BITS) > chance / 1000


def test_false_alarms_are_as_rare_as_is_reported() -> None:
    """S of many keys at every shift of an unmarked film has the tail of chi squared at most."""
    frames = (frame[..., 1] for frame in film.frames(12))
    total = next(iter(mark_sums.by_phase(next(mark_sums.pieces(frames, film.RATE))[0])))
    folded = mark_match.fold(total, 1.0, (0.0, 0.0, 1.0))[0, 0]
    spectrum, square = fft.rfft2(folded), fft.rfft2(folded**2)
    values = []
    for number in range(60):
        code = Code.of(number.to_bytes(32, "big"))
        own = code.owners == np.arange(BITS)[:, None, None]
        sums = fft.irfft2(spectrum * mark_match.templates(code), s=(TILE, TILE))
        squares = fft.irfft2(square * np.conj(fft.rfft2(own.astype(float))), s=(TILE, TILE))
        values.append(np.sum(sums**2 / squares, axis=0).ravel())
    every = np.concatenate(values)
    assert every.mean() == pytest.approx(BITS, rel=0.02)
    for chance in (1e-2, 1e-3, 1e-4):
        assert (every > stats.chi2.isf(chance, BITS)).mean() < 1.5 * chance
    assert every.max() < mark_search.threshold(1e-6)


def test_pictures_without_any_content_are_no_mistake() -> None:
    pictures = (np.zeros((480, 640), np.uint8), np.full((2, 2), 7, np.uint8))
    for frames in ([pictures[0]] * 2, [pictures[1]] * 2, []):
        (seen,) = mark_search.search(frames, film.RATE, [film.KEY])
        assert not seen.present


def test_sums_are_of_what_changes_and_of_every_frame_once() -> None:
    rng = np.random.default_rng(0)
    still = rng.integers(0, 255, (96, 128), np.uint8)
    for count in (1, 2, 3, 4, 5, 20):
        changes = list(mark_sums.changes([still] * count, film.RATE))
        assert len(changes) == count
        assert not np.any(changes)
    moving = [rng.integers(0, 255, (96, 128), np.uint8) for _ in range(60)]
    parts = list(mark_sums.pieces(moving, film.RATE))
    assert [added for _, added in parts] == [50, 10]
    every = np.sum(list(mark_sums.changes(moving, film.RATE)), 0)
    np.testing.assert_allclose(sum(bins.sum(0) for bins, _ in parts), every, atol=1e-4)
