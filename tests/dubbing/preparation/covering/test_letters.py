"""Lines of letters, and boxes behind them."""

import cv2
import numpy as np
import pytest

from dubbing.preparation.covering.letters import beside, veils

S = 120
LETTERS, BOX = np.s_[60:72, 30:90], np.s_[56:77, 26:95]


def caption(veil: float, colour: int) -> tuple[np.ndarray, np.ndarray]:
    """A face (S, S, 3) behind a box of that opacity and letters; and the letters (S, S)."""
    image = np.full((S, S, 3), 170.0)
    image[BOX] += veil * (colour - image[BOX])
    letters = np.zeros((S, S), np.uint8)
    letters[LETTERS] = 1
    image[LETTERS][:, ::4] = 250
    return image.round().astype(np.uint8), letters


@pytest.mark.parametrize(("veil", "colour"), [(0.6, 0), (0.3, 0), (1.0, 20), (0.6, 255)])
def test_the_box_behind_letters_is_found(veil: float, colour: int) -> None:
    found = veils(*caption(veil, colour)) > 0
    box = np.zeros((S, S), bool)
    box[BOX] = True
    assert found[box].mean() > 0.99
    assert found[~box].sum() < 0.15 * box.sum()  # its edge is 2 px wide


def test_a_mouth_that_is_open_behind_it_does_not_hide_it() -> None:
    image, letters = caption(0.6, 0)
    image[44:64, 50:70] = 20
    assert (veils(image, letters)[BOX] > 0).mean() > 0.99


def test_a_box_goes_on_beside_its_letters_and_may_have_round_corners() -> None:
    image, letters = caption(0.0, 0)
    box = np.zeros((S, S), np.uint8)
    cv2.rectangle(box, (32, 56), (100, 76), 1, -1)
    cv2.rectangle(box, (24, 63), (110, 69), 1, -1)
    for x, y in ((32, 63), (32, 69), (102, 63), (102, 69)):
        cv2.circle(box, (x, y), 7, 1, -1)
    bare = (box > 0) & (letters == 0)
    image[bare] = 20
    image[LETTERS][:, 1::2] = 20
    for mouth in (False, True):
        if mouth:
            image[44:56, 46:64] = 20
        found = veils(image, letters) > 0
        assert found[box > 0].mean() > 0.97
        assert found[box == 0].sum() < 0.15 * box.sum()


def test_letters_without_a_box_have_none() -> None:
    image, letters = caption(0.0, 0)
    assert not veils(image, letters).any()
    image[:64] = 60  # as where a chin ends
    assert not veils(image, letters).any()
    assert not veils(image, np.zeros_like(letters)).any()


def test_letters_over_the_mouth_belong_to_the_line_that_goes_on_beside_it() -> None:
    letters, mouth = (np.zeros((S, S), np.uint8) for _ in range(2))
    letters[60:70, 20:100:3] = 1
    mouth[50:80, 50:70] = 1
    found = beside(letters, mouth)
    assert found[60:70, 50:70].all()
    assert found.sum() == 200
    letters[:, 66:] = 0  # it ends in the mouth: a glint may do so
    assert not beside(letters, mouth).any()
    assert not beside(letters, np.zeros_like(mouth)).any()
