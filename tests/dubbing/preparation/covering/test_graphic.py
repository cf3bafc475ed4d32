"""Places of a graphic in a mask."""

import cv2
import numpy as np

from dubbing.preparation.covering.graphic import without_holes


def test_what_has_the_colour_of_skin_in_a_graphic_is_part_of_it_but_a_face_in_a_ring_is_not() -> (
    None
):
    mask = np.zeros((90, 90), np.uint8)
    cv2.rectangle(mask, (5, 5), (40, 60), 1, -1)
    cv2.circle(mask, (65, 65), 18, 1, 7)
    whole = mask.copy()
    mask[20:30, 10:20] = 0
    np.testing.assert_array_equal(without_holes(mask), whole)
