"""The crop window and the way back."""

import numpy as np
import pytest

from dubbing.preparation.tracking.cropping import choose_windows, crop, paste, to_crop, turned

STILL = np.zeros(1, int)  # the first shot, not turned


def picture(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, (height, width, 3), np.uint8)


def test_a_square_clip_filled_by_the_head_is_left_alone() -> None:
    box = np.tile([140.0, 171, 374, 444], (5, 1))
    window = choose_windows(box, np.zeros(5, int), np.zeros(5, int), (512, 512), 25.0)
    assert (window == [0, 0, 512, 0]).all()
    image = picture(512, 512)
    assert np.array_equal(crop(image, window[0], 512), image)


@pytest.mark.parametrize(("width", "height"), [(700, 700), (1280, 721), (270, 480)])
def test_a_crop_can_have_the_pixels_of_any_film(width: int, height: int) -> None:
    head = np.array([0.3 * width, 0.2 * height, 0.7 * width, 0.65 * height])
    (window,) = choose_windows(head[None], STILL, STILL, (width, height), 25.0)
    x0, y0, side, _ = window.astype(int)
    image = picture(height, width)
    assert side % 8 == 0
    assert np.array_equal(crop(image, window, side), image[y0 : y0 + side, x0 : x0 + side])


def test_a_head_in_a_tall_frame_gets_a_window_at_rest_inside_the_frame() -> None:
    sway = 40 * np.sin(np.arange(50) / 5)
    box = np.tile([400.0, 310, 670, 620], (50, 1)) + sway[:, None] * [1, 0, 1, 0]
    window = choose_windows(box, np.zeros(50, int), np.zeros(50, int), (1080, 1920), 25.0)
    assert (window == window[0]).all()
    x0, y0, side, _ = window[0]
    assert side == 624
    assert x0 >= 0
    assert y0 >= 0
    assert x0 + side <= 1080
    middle = to_crop(np.array([535.0, 465.0]), window[0], 512, (1080, 1920))
    assert middle == pytest.approx([256, 512 * 0.55], abs=12)


def test_a_walking_head_is_followed_smoothly_and_not_over_a_cut() -> None:
    x = np.concatenate((np.linspace(100, 1500, 100), np.full(50, 300.0)))
    box = np.stack((x, np.full(150, 300.0), x + 200, np.full(150, 500.0)), axis=1)
    segment = np.repeat([0, 1], [100, 50])
    window = choose_windows(box, segment, np.zeros(150, int), (1920, 1080), 25.0)
    assert len(np.unique(window[:, 2])) == 1
    assert np.abs(np.diff(window[:100, 0])).max() <= 20
    assert (window[100:] == window[100]).all()
    assert (window == window.round()).all()


@pytest.mark.parametrize("side", [128, 200, 96])
def test_pasting_changes_nothing_where_the_mask_is_empty(side: int) -> None:
    frame, size = picture(240, 320), 128
    window = np.array([40.0, 10.0, side, 0])
    mask = np.zeros((size, size), np.uint8)
    mask[40:90, 30:100] = 255
    mask[38:40] = 90
    new = np.full((size, size, 3), 200, np.uint8)
    out, laid = paste(frame, window, new, mask)
    assert np.array_equal(out[laid == 0], frame[laid == 0])
    assert laid.max() == 255
    allowed = np.zeros(frame.shape[:2], bool)
    scale = side / size
    top, bottom = int(10 + 37 * scale) - 1, int(10 + 91 * scale) + 2
    allowed[top:bottom, 40 : 40 + side] = True
    assert np.array_equal(out[~allowed], frame[~allowed])
    middle = (int(10 + 65 * scale), int(40 + 65 * scale))
    assert (out[middle] == 200).all()


def test_an_empty_mask_gives_the_frame_and_a_full_one_gives_the_crop_back() -> None:
    frame = picture(240, 320)
    window = np.array([40.0, 10.0, 128.0, 0])
    part = crop(frame, window, 128)
    nothing = np.zeros((128, 128), np.uint8)
    assert np.array_equal(paste(frame, window, 255 - part, nothing)[0], frame)
    assert np.array_equal(paste(frame, window, part, nothing + 255)[0], frame)


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_head_that_lies_is_upright_in_its_crop_and_lies_where_it_is_pasted(turns: int) -> None:
    upright = picture(240, 320)
    lying = np.ascontiguousarray(np.rot90(upright, -turns))
    size = lying.shape[1], lying.shape[0]
    head = np.array([[200.0, 30.0], [260.0, 100.0]])
    box = turned(head, -turns % 4, (320, 240))
    assert np.array_equal(turned(box, turns, size), head)
    boxes = np.concatenate((box.min(0), box.max(0)))[None]
    (window,) = choose_windows(boxes, STILL, np.array([turns]), size, 25.0)
    (same,) = choose_windows(head.reshape(1, 4), STILL, STILL, (320, 240), 25.0)
    assert window.tolist() == [*same[:3], turns]
    part = crop(lying, window, 128)
    assert np.array_equal(part, crop(upright, same, 128))
    places = to_crop(box, window, 128, size)
    np.testing.assert_allclose(places, to_crop(head, same, 128, (320, 240)))
    mask = np.zeros((128, 128), np.uint8)
    mask[40:90, 30:100] = 200
    pasted, laid = paste(lying, window, 255 - part, mask)
    expected = paste(upright, same, 255 - part, mask)
    assert np.array_equal(np.rot90(pasted, turns), expected[0])
    assert np.array_equal(np.rot90(laid, turns), expected[1])
