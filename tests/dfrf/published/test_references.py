import math

import torch
from torch import Tensor
from torch.autograd import gradcheck

from dfrf.field.encodings import frequency_encoding
from dfrf.field.reference_encoder import BILINEAR_SPREAD, sharpened
from dfrf.published.references import (
    ReferenceCNN,
    bilinear,
    clamp_to_image,
    nearest,
    reference_input,
)

# Inside, between, on the border, and outside of a picture of 6 rows and 9 columns.
PLACES = [[2.3, 4.9], [0.0, 0.0], [7.6, 3.2], [8.0, 5.0], [-3.0, 2.5], [4.2, 11.0], [30.0, -7.0]]


def slow_bilinear(image: Tensor, column: float, row: float) -> Tensor:
    """The four pixels round a place of an image (H, W, C), border going on."""
    height, width = image.shape[:2]
    left, top = math.floor(column), math.floor(row)
    total = torch.zeros_like(image[0, 0])
    for r, c in ((top, left), (top, left + 1), (top + 1, left), (top + 1, left + 1)):
        weight = (1 - abs(column - c)) * (1 - abs(row - r))
        total = total + weight * image[min(max(r, 0), height - 1), min(max(c, 0), width - 1)]
    return total


def test_bilinear_against_a_loop() -> None:
    maps = torch.randn(2, 6, 9, 3, dtype=torch.float64)
    places = torch.tensor([PLACES, PLACES[::-1]], dtype=torch.float64)
    read = bilinear(maps, places)
    assert read.shape == (2, 7, 3)
    for n in range(2):
        for i in range(7):
            column, row = places[n, i].tolist()
            torch.testing.assert_close(read[n, i], slow_bilinear(maps[n], column, row))


def test_nearest_against_a_loop() -> None:
    maps = torch.randn(2, 6, 9, 3)
    places = torch.tensor([PLACES, PLACES[::-1]])
    read = nearest(maps, places)
    for n in range(2):
        for i in range(7):
            column, row = places[n, i].tolist()
            pixel = maps[n, min(max(round(row), 0), 5), min(max(round(column), 0), 8)]
            assert torch.equal(read[n, i], pixel)


def test_both_read_the_same_at_pixel_centres_and_keep_leading_shapes() -> None:
    maps = torch.randn(3, 6, 9, 4)
    places = torch.stack(
        [torch.randint(0, 9, (3, 2, 5)), torch.randint(0, 6, (3, 2, 5))], -1
    ).float()
    torch.testing.assert_close(bilinear(maps, places), nearest(maps, places))
    assert nearest(maps, places).shape == (3, 2, 5, 4)


def test_sharpening_keeps_means_and_ramps_and_takes_back_a_variance() -> None:
    point = torch.zeros(1, 9, 9, 3)
    point[0, 4, 4] = 1
    kernel = sharpened(point)[0, :, :, 1]
    away = torch.arange(9.0) - 4
    torch.testing.assert_close(kernel.sum(), torch.tensor(1.0))
    for along in (kernel.sum(0), kernel.sum(1)):
        torch.testing.assert_close((along * away**2).sum(), torch.tensor(-BILINEAR_SPREAD))
    ramp = torch.arange(9.0)[None, None, :, None].expand(1, 5, 9, 3)
    torch.testing.assert_close(sharpened(ramp)[:, :, 1:-1], ramp[:, :, 1:-1])
    torch.testing.assert_close(sharpened(torch.ones(2, 4, 5, 3)), torch.ones(2, 4, 5, 3))


def test_colours_read_between_pixels_and_mixed_keep_their_gradients() -> None:
    """Two images of one smooth texture, read at the same random places a little apart."""
    generator = torch.Generator().manual_seed(0)
    noise = torch.rand(1, 3, 60, 60, generator=generator)
    image = torch.nn.functional.avg_pool2d(noise, 3, stride=1).permute(0, 2, 3, 1)
    start = torch.rand(400, 2, generator=generator) * 50 + 3

    def gradients(of: Tensor) -> float:
        apart = torch.randn(4, 400, 2, generator=torch.Generator().manual_seed(1)) * 0.4
        mixed = [
            bilinear(of.expand(4, -1, -1, -1), start + apart + shift).mean(0)
            for shift in (torch.zeros(2), torch.tensor([1.0, 0.0]))
        ]
        return float(((mixed[1] - mixed[0]) ** 2).mean())

    exact = float(((image[:, :, 1:] - image[:, :, :-1]) ** 2).mean())
    plain, sharp = gradients(image) / exact, gradients(sharpened(image)) / exact
    assert plain < 0.6
    assert 0.7 < sharp < 1.1


def test_gradients_of_bilinear() -> None:
    maps = torch.randn(2, 5, 4, 2, dtype=torch.float64, requires_grad=True)
    places = (torch.rand(2, 3, 2, dtype=torch.float64) * 2.5 + 0.2).requires_grad_()
    assert gradcheck(bilinear, (maps, places))


def test_a_slope_is_felt_in_its_own_direction() -> None:
    rows, columns = torch.meshgrid(torch.arange(6.0), torch.arange(9.0), indexing="ij")
    maps = (2 * columns - 3 * rows)[None, ..., None]
    place = torch.tensor([[[3.4, 2.2]]], requires_grad=True)
    bilinear(maps, place).sum().backward()
    assert place.grad is not None
    torch.testing.assert_close(place.grad[0, 0], torch.tensor([2.0, -3.0]))


def test_nearest_teaches_maps_only() -> None:
    maps = torch.zeros(1, 3, 3, 1, requires_grad=True)
    place = torch.tensor([[[1.2, 0.4], [1.4, 0.0]]], requires_grad=True)
    nearest(maps, place).sum().backward()
    assert place.grad is None
    assert maps.grad is not None
    assert maps.grad[0, 0, 1, 0] == 2


def test_clamp_to_image() -> None:
    places = clamp_to_image(torch.tensor([[-1.0, 7.0], [20.0, 2.5]]), height=6, width=9)
    assert places.tolist() == [[0.0, 5.0], [8.0, 2.5]]


def test_input_is_encoded_colour_then_encoded_camera_centre() -> None:
    images, origins = torch.rand(2, 3, 4, 3), torch.randn(2, 3)
    x = reference_input(images, origins)
    assert x.shape == (2, 66, 3, 4)
    torch.testing.assert_close(x[1, :33, 2, 3], frequency_encoding(images[1, 2, 3], 5))
    torch.testing.assert_close(x[1, 33:, 0, 1], frequency_encoding(origins[1], 5))


def test_cnn_against_a_loop() -> None:
    net = ReferenceCNN(width=4, feature_dim=5, octaves=1)
    images, origins = torch.rand(1, 4, 5, 3), torch.randn(1, 3)
    x = reference_input(images, origins, 1)[0]
    for conv in (net.conv1, net.conv2):
        assert conv.bias is not None
        padded = torch.zeros(x.shape[0], 6, 7)
        padded[:, 1:-1, 1:-1] = x
        y = torch.zeros(conv.out_channels, 4, 5)
        for r in range(4):
            for c in range(5):
                patch = padded[None, :, r : r + 3, c : c + 3]
                y[:, r, c] = (conv.weight * patch).sum((1, 2, 3)) + conv.bias
        x = y.clamp_min(0)
    expected = torch.einsum("fc,chw->hwf", net.out.weight, x) + net.out.bias
    torch.testing.assert_close(net(images, origins)[0], expected, atol=1e-5, rtol=1e-5)


def test_a_pixel_reaches_five_by_five() -> None:
    net = ReferenceCNN(width=8, feature_dim=8)
    images, origins = torch.rand(1, 9, 9, 3), torch.zeros(1, 3)
    other = images.clone()
    other[0, 4, 4] = 1 - other[0, 4, 4]
    changed = (net(images, origins) - net(other, origins)).abs().amax(-1)[0] > 1e-7
    assert changed[2:7, 2:7].any()
    changed[2:7, 2:7] = False
    assert not changed.any()
