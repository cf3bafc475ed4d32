import numpy as np
import pytest

from dubbing.provenance.mark import BITS, TILE, Code, Mark
from dubbing.provenance.mark_key import bits_of
from tests.dubbing.provenance import film

LEAST = 44.0  # dB

SIGNS = [-1.0, 1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0]
OWNERS = [53, 31, 31, 12, 31, 32, 52, 9]


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.mean((one.astype(float) - other) ** 2)))


@pytest.mark.parametrize(
    "places",
    [
        [(0.0, 0.0, 480.0)],  # all of the height
        [film.HEAD],
        [(-40.0, 300.0, 260.0)],  # beyond the frame
        [(20.0, 20.0, 120.0), (400.0, 200.0, 160.0)],
    ],
)
def test_a_marked_frame_is_nearly_the_unmarked_one(
    places: list[tuple[float, float, float]],
) -> None:
    (plain,) = film.frames(1)
    mark = Mark(film.KEY, bits_of(film.ID), *film.SIZE)
    made = mark.draw(plain, places)
    assert LEAST <= psnr(made, plain) < 60
    assert np.abs(made.astype(int) - plain).max() <= 8


def test_pixels_far_from_the_head_stay() -> None:
    (plain,) = film.frames(1)
    (made,) = film.marked([plain])
    left, top, side = film.HEAD
    changed = (made != plain).any(-1)
    assert changed[int(top) : int(top + side), int(left) : int(left + side)].mean() > 0.5
    rows, columns = np.flatnonzero(changed.any(1)), np.flatnonzero(changed.any(0))
    assert rows[0] >= top - side / 4
    assert rows[-1] <= top + side * 5 / 4
    assert columns[0] >= left - side / 4
    assert columns[-1] <= left + side * 5 / 4


def test_a_head_out_of_the_picture_marks_nothing() -> None:
    (plain,) = film.frames(1)
    mark = Mark(film.KEY, bits_of(film.ID), *film.SIZE)
    for places in ([], [(2000.0, 50.0, 100.0)]):
        np.testing.assert_array_equal(mark.draw(plain, places), plain)


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
