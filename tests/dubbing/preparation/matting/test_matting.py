"""Jaw polygon, matte and inpaint mask on made pictures."""

import cv2
import numpy as np

from dubbing.preparation.matting.matting import (
    above,
    above_jaw,
    component_at,
    covered,
    dilate,
    fill_polygon,
    head_matte,
    in_bytes,
    inpaint_mask,
    opacity,
    without_holes,
)

SIZE = 128


def jaw(roll: float = 0.0) -> np.ndarray:
    """A jaw line (K, 2) px from ear to ear: half an ellipse, turned by roll radians."""
    angle = np.linspace(np.pi, 0, 17)
    line = np.stack((30 * np.cos(angle), 40 * np.sin(angle)), axis=1)
    turn = np.array([[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]])
    return line @ turn.T + [64, 60]


def test_above_the_jaw_is_above_the_jaw() -> None:
    inside = fill_polygon(above_jaw(jaw(), SIZE), SIZE)
    assert inside[20, 64] == inside[95, 64] == inside[5, 5] == inside[50, 120] == 255
    assert inside[105, 64] == inside[70, 10] == inside[70, 120] == inside[127, 0] == 0


def test_the_cut_turns_with_the_head() -> None:
    inside = fill_polygon(above_jaw(jaw(roll=0.5), SIZE), SIZE)
    chin = jaw(roll=0.5)[8]
    down = np.array([-np.sin(0.5), np.cos(0.5)])
    for step, expected in ((-6, 255), (6, 0)):
        column, row = (chin + step * down).round().astype(int)
        assert inside[row, column] == expected


def test_matte_of_a_whole_person_ends_at_the_jaw() -> None:
    image = np.full((SIZE, SIZE, 3), 90, np.uint8)
    person = np.zeros((SIZE, SIZE), np.float32)
    person[10:, 34:95] = 1  # head, neck and torso
    matte = head_matte(in_bytes(opacity(image, person)), above(jaw(), SIZE), np.array([64.0, 50.0]))
    assert matte.dtype == np.uint8
    assert (matte[20:60, 40:88] > 250).all()
    assert matte[112:].max() == 0
    assert matte[:, :25].max() == 0
    widened = inpaint_mask(matte)
    assert widened[matte > 5].all()
    assert not widened[118:].any()


def test_another_person_is_not_part_of_the_head() -> None:
    mask = np.zeros((SIZE, SIZE), bool)
    mask[10:60, 10:50] = mask[10:60, 80:120] = True
    kept = component_at(mask, np.array([30.0, 30.0]))
    assert kept[30, 30]
    assert not kept[30, 100]


def test_glints_are_closed_and_gaps_at_the_edge_stay() -> None:
    matte = np.zeros((SIZE, SIZE), np.uint8)
    matte[20:100, 20:100] = 255
    matte[50:53, 50:53] = 40  # a glint
    matte[20:40, 60:64] = 0  # a gap that reaches the background
    closed = without_holes(matte)
    assert (closed[50:53, 50:53] == 255).all()
    assert np.array_equal(closed[20:40, 60:64], matte[20:40, 60:64])
    assert closed[0].max() == 0


def test_neck_and_collar_beside_the_jaw_are_not_restored_where_they_are_seen() -> None:
    size = 512
    rows, columns = np.indices((size, size))
    matte = np.where(np.hypot(rows - 240, columns - 256) < 120, 255, 0).astype(np.uint8)
    outline = np.array([[140.0, 250], [256, 360], [372, 250]])
    region = covered(inpaint_mask(matte), matte, outline)
    above = rows < 248
    assert np.array_equal(region[above], inpaint_mask(matte)[above])
    below = rows > 252
    jaw = dilate(matte > 0, 3)
    assert np.array_equal(region[below], (inpaint_mask(matte) & jaw)[below])
    assert (inpaint_mask(matte) & ~region)[below].sum() > 500


def test_without_a_head_nothing_is_covered() -> None:
    outline = np.array([[140.0, 250], [256, 360], [372, 250]])
    matte = np.zeros((512, 512), np.uint8)
    assert not covered(inpaint_mask(matte), matte, outline).any()


def test_a_share_in_bytes_is_the_nearest_of_256() -> None:
    share = np.array([[0, 0.5, 1], [0.2 / 255, 100.6 / 255, 1.3]], np.float32)
    assert np.array_equal(in_bytes(share), [[0, 128, 255], [0, 101, 255]])


def test_opacity_follows_colours_of_one_brightness() -> None:
    size = 320
    y, x = np.mgrid[:size, :size]
    inside = x < 160 + 4 * np.sin(y / 9)  # a profile
    image = np.where(inside[..., None], (190, 105, 85), (128, 128, 128)).astype(np.uint8)
    assert np.ptp(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)) < 3
    noise = np.random.default_rng(0).normal(0, 3, image.shape)
    image = np.clip(image + noise, 0, 255).astype(np.uint8)
    coarse = cv2.GaussianBlur((x < 163).astype(np.float32), (0, 0), 3)  # knows no lips
    found = opacity(image, coarse)
    near = np.abs(x - 160) < 16
    assert np.abs(found - inside)[near].mean() < 0.06
    assert np.abs(coarse - inside)[near].mean() > 0.1
