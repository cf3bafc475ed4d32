"""Steps of networks, against the same written out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from dubbing.errors import ExplainedError
from dubbing.face.finding.graph_network import GraphNetwork
from dubbing.face.finding.graph_steps import STEPS
from dubbing.face.weight_paths import FACE_WEIGHTS, HAND_WEIGHTS, PERSON_WEIGHTS


def run(op: str, *inputs: Tensor, weights: tuple[Tensor, ...] = (), **settings: Any) -> Tensor:
    return STEPS[op]({"in_place": False} | settings, *weights)(*inputs)


def random(*shape: int) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(sum(shape))) - 0.5


@pytest.mark.parametrize("groups", [1, 4])
@pytest.mark.parametrize(("kernel", "padding"), [(3, (0, 1)), (3, (1, 1)), (5, (1, 2))])
def test_edges_of_a_convolution_may_be_unequal(
    groups: int, kernel: int, padding: tuple[int, int]
) -> None:
    images, filters, bias = random(2, 4, 8, 8), random(4, 4 // groups, kernel, kernel), random(4)
    stride = 1 if padding[0] == padding[1] else 2
    found = run(
        "convolve", images, weights=(filters, bias), stride=stride, groups=groups, padding=padding
    )
    padded = F.pad(images, padding * 2)
    torch.testing.assert_close(found, F.conv2d(padded, filters, bias, stride, groups=groups))


def test_a_transposed_convolution() -> None:
    images, filters, bias = random(2, 3, 4, 5), random(3, 2, 2, 2), random(2)
    found = run("convolve_transposed", images, weights=(filters, bias), stride=2)
    torch.testing.assert_close(found, F.conv_transpose2d(images, filters, bias, 2))


def test_fewer_channels_are_added_to_the_first_of_each_part() -> None:
    narrow, wide = random(2, 4, 3, 3), random(2, 6, 3, 3)
    expected = wide.clone()
    expected[:, [0, 1, 3, 4]] += narrow
    torch.testing.assert_close(run("add_narrow", narrow, wide, parts=2), expected)
    assert not torch.equal(wide, expected)
    torch.testing.assert_close(run("add_narrow", narrow, wide, parts=2, in_place=True), expected)
    torch.testing.assert_close(wide, expected)


def test_parts_lie_side_by_side_in_the_channels() -> None:
    images = random(2, 6, 3, 3)
    torch.testing.assert_close(run("take", images, parts=3, places=[1]), images[:, 2:4])
    found = run("take", images, parts=3, places=[0, 2, 2])
    torch.testing.assert_close(found, images[:, [0, 1, 4, 5, 4, 5]])


def test_shapes_follow_the_order_of_the_source() -> None:
    """There the channels of a pixel lie together."""
    images = random(1, 2, 2, 2)
    found = run("reshape", images, shape=[4, 2])
    torch.testing.assert_close(found[0], images[0].flatten(1).T)


def test_a_box_is_turned_with_its_ends_and_a_crop_cuts_it_out() -> None:
    """A ramp cut out by a box shows where its pixels lie."""
    turn = np.deg2rad(30)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    corners = np.array([[-4, -2], [4, -2], [4, 2], [-4, 2]]) @ axes.T + [16, 15]
    flat = np.pad(corners, ((0, 0), (0, 1)))[None]
    boxes = run(
        "box", torch.tensor(flat).float(), size=4, scale=1.5, ends=[[0, 1]], points=[[0, 1, 2, 3]]
    )
    row, column = torch.meshgrid(torch.arange(32.0), torch.arange(32.0), indexing="ij")
    ramps = torch.stack((column, row))[None]
    shares = (np.stack(np.meshgrid(np.arange(4), np.arange(4)), -1) + 0.5) / 4 - 0.5
    expected = shares * [12, 6] @ axes.T + [16, 15] - 0.5
    found = run("crop", ramps, boxes, size=4)[0].permute(1, 2, 0)
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_outside_of_the_image_a_crop_is_zero() -> None:
    boxes = torch.tensor([[[1.0, 0, -2], [0, 1, 0]]])
    found = run("crop", torch.ones(1, 1, 8, 8), boxes, size=4)
    np.testing.assert_array_equal(found[0, 0], [[0, 0, 1, 1]] * 4)


@pytest.mark.parametrize(
    "path", (FACE_WEIGHTS | HAND_WEIGHTS | PERSON_WEIGHTS).values(), ids=lambda p: p.stem
)
def test_what_ships_works_and_leaves_the_number_of_threads(path: Path) -> None:
    threads = torch.get_num_threads()
    network = GraphNetwork(path)
    assert network.works()
    assert torch.get_num_threads() == threads
    network._expected[0] += 1
    assert not network.works()


def test_numbers_stay_whole_where_others_are_rounded() -> None:
    network = GraphNetwork(FACE_WEIGHTS["face_landmarks"])
    exact = network.test_results()
    with torch.autocast("cpu", torch.bfloat16):
        assert network.test_results() == exact


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ExplainedError) as error:
        GraphNetwork(tmp_path / "face_detector.safetensors")
    assert error.value.what.startswith("face detector weights cannot be read")
    assert error.value.remedy == "install dfrf again"
