"""Places of a graphic in a mask."""

import cv2
import numpy as np

from dubbing.preparation.covering.graphic import outline, without_holes


def test_what_has_the_colour_of_skin_in_a_graphic_is_part_of_it_but_a_face_in_a_ring_is_not() -> (
    None
):
    mask = np.zeros((90, 90), np.uint8)
    cv2.rectangle(mask, (5, 5), (40, 60), 1, -1)
    cv2.circle(mask, (65, 65), 18, 1, 7)
    whole = mask.copy()
    mask[20:30, 10:20] = 0
    np.testing.assert_array_equal(without_holes(mask), whole)


def test_an_outline_is_as_wide_as_it_is_on_skin() -> None:
    letters, wide = np.zeros((2, 60, 60), np.uint8)
    cv2.putText(letters, "up", (8, 40), cv2.FONT_HERSHEY_DUPLEX, 1.0, 1, 2)
    cv2.dilate(letters, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7)), wide)
    skin, odd = wide >= 0, (wide > 0) & (letters == 0)
    skin[:, :30] = False  # lips, whose colours say nothing
    assert outline(letters, skin, odd, 6) == 3
    assert outline(letters, skin, odd & False, 6) == 1
    shade = odd & (np.arange(60)[:, None] > 36)  # a shadow at one side
    assert outline(letters, skin, shade, 6) == 1
    assert outline(letters, skin & False, odd, 6) == 1
