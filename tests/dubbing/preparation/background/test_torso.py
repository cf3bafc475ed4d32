"""The torso of other frames, on made pictures: a patterned shirt that moves under a jaw."""

import cv2
import numpy as np

from dubbing.preparation.background.torso import follow, reached, torso

SIZE = 256
RNG = np.random.default_rng(0)
SHIRT = cv2.GaussianBlur(RNG.integers(0, 255, (400, 400, 3), np.uint8), (0, 0), 2.5)
SHIRT = np.clip(4 * (SHIRT.astype(float) - 128) + 128, 30, 220).astype(np.uint8)


def frame(shift: float, jaw: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Picture, the same without head, person mask, inpaint mask; the shirt begins at row 100."""
    motion = np.array([[1, 0, shift - 60], [0, 1, -60.0]])
    clean = cv2.warpAffine(SHIRT, motion, (SIZE, SIZE))
    clean[:100] = 90
    image, inpaint_mask = clean.copy(), np.zeros((SIZE, SIZE), bool)
    inpaint_mask[20:jaw, 70:190] = True
    image[inpaint_mask] = [220, 150, 120]
    person = np.zeros((SIZE, SIZE), np.uint8)
    person[100:] = person[inpaint_mask] = 255
    return image, clean, person, inpaint_mask


FRAMES = [frame(2 * np.sin(k), 130 + 20 * (k % 3)) for k in range(12)]
FOUND = torso(*(np.stack([f[k] for f in FRAMES]) for k in (0, 2, 3)))


def test_what_one_jaw_covers_is_taken_from_frames_that_show_it() -> None:
    assert FOUND is not None
    wall = np.full((SIZE, SIZE, 3), 90, np.float32)
    for image, clean, _, inpaint_mask in FRAMES[2::3]:  # the jaw is as low as it gets
        motion = FOUND.motion(image)
        assert motion is not None
        box = slice(4, 250), slice(60, 200)
        part, rest = FOUND.fill(image, inpaint_mask, wall[box], motion, box)
        filled, left = image.copy(), np.zeros_like(inpaint_mask)
        filled[box], left[box] = part, rest
        new = inpaint_mask & ~left
        assert new[140:165, 80:180].mean() > 0.9  # down from where the highest jaw ended
        assert not new[:125].any()  # and no further: no frame showed that
        assert np.array_equal(filled[~new], image[~new])
        assert np.abs(filled[new].astype(int) - clean[new]).mean() < 6


def test_what_few_frames_show_counts_where_they_agree() -> None:
    """Two of twelve show the chest higher up; where their colours differ, nobody knows it."""
    frames = [frame(2 * np.sin(k), 115 if k in (3, 8) else 170) for k in range(12)]
    images, _, person, masks = (np.stack([f[k] for f in frames]) for k in range(4))
    images[8, 120:160, 130:190] = 250
    found = torso(images, person, masks)
    assert found is not None
    assert found.visible[130:155, 80:120].mean() > 0.9
    assert found.visible[130:155, 140:180].mean() < 0.1


def test_light_beside_the_mask_goes_on_in_it_without_a_seam() -> None:
    assert FOUND is not None
    image, clean, _, inpaint_mask = FRAMES[2]
    # A shadow that falls from the right, deepest at the mask's lower end.
    row, column = np.mgrid[:SIZE, :SIZE]
    shadow = 1 - 0.4 * np.exp(-((row - 170) ** 2) / 1800) * np.clip((column - 60) / 140, 0, 1)
    darker, truth = (np.rint(one * shadow[..., None]).astype(np.uint8) for one in (image, clean))
    motion = FOUND.motion(image)
    assert motion is not None
    box = slice(4, 250), slice(60, 200)
    wall = np.full((246, 140, 3), 90, np.float32)
    part, left = FOUND.fill(darker, inpaint_mask, wall, motion, box)
    new = (inpaint_mask[box] & ~left)[:, 60:]  # where the shadow is
    lower = new & (row[box][:, 60:] > 155)
    assert lower.sum() > 300
    apart = part[:, 60:].astype(int) - truth[box][:, 60:]
    assert np.abs(apart[lower].mean(0)).max() < 5


def test_what_lies_beside_the_mask_and_is_no_torso_lights_nothing() -> None:
    """As a collar that moved: its colours would go on in the mask as a bright spot."""
    assert FOUND is not None
    image, _, _, inpaint_mask = FRAMES[2]
    motion = FOUND.motion(image)
    assert motion is not None
    box, wall = (slice(4, 250), slice(60, 200)), np.full((246, 140, 3), 90, np.float32)
    for colour in (255, 0):
        other = image.copy()
        other[140:160, 190:200] = colour
        other[171:176, 100:120] = colour
        both = [FOUND.fill(one, inpaint_mask, wall, motion, box)[0] for one in (image, other)]
        plain, filled = (one[inpaint_mask[box]].astype(int) for one in both)
        assert np.abs(plain - filled).mean() < 1.5  # 4.5 where all of it counts
        assert (np.abs(plain - filled) > 40).mean() < 0.005


def test_motion_is_found_and_a_blank_is_not_followed() -> None:
    assert FOUND is not None
    moved = np.roll(FRAMES[6][0], (3, -5), (0, 1))
    motion = FOUND.motion(moved)
    still = FOUND.motion(FRAMES[6][0])
    assert motion is not None
    assert still is not None
    np.testing.assert_allclose(motion[:, 2] - still[:, 2], [-5, 3], atol=0.4)
    assert FOUND.motion(np.full_like(moved, 128)) is None
    blank = np.zeros((SIZE, SIZE), np.uint8)
    assert follow(blank, blank, np.zeros((3, 1, 2), np.float32)) is None


def test_its_motion_is_known_to_a_fraction_of_a_pixel() -> None:
    """Though it is measured at half the size."""
    assert FOUND is not None
    for k, (image, *_) in enumerate(FRAMES):
        motion = FOUND.motion(image)
        assert motion is not None
        middle = motion @ np.array([SIZE / 2, SIZE / 2, 1])
        there = [2 * np.sin(k) - 2 * np.sin(len(FRAMES) // 2), 0]
        np.testing.assert_allclose(middle - SIZE / 2, there, atol=0.15)


def test_a_shot_without_texture_has_no_torso() -> None:
    images = np.full((6, SIZE, SIZE, 3), 120, np.uint8)
    person, inpaint_masks = (np.stack([f[k] for f in FRAMES[:6]]) for k in (2, 3))
    assert torso(images, person, inpaint_masks) is None


def test_what_is_filled_hangs_together_from_below() -> None:
    region, seen = np.zeros((512, 512), bool), np.ones((512, 512), bool)
    region[80:400, 64:448] = True
    seen[240, 160:350] = False  # a gap: nothing above it is reached
    here = reached(region, seen, 1.0)
    assert here[241:400, 160:350].all()
    assert not here[:240, 160:350].any()
    assert not (here & ~region).any()
    heights = here.sum(0)[64:448]
    assert np.abs(np.diff(heights)).max() <= 40  # no cliff where the gap ends
    # One column, wide enough that its end is even: as far up as it is seen, row by row.
    for column in (100, 255):
        row = 399
        while row >= 80 and seen[row, column]:
            row -= 1
        assert heights[column - 64] == 399 - row
