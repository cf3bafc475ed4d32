"""The warp: which way it moves what is read, along which axis, in which unit, and how far."""

from dataclasses import replace

import pytest
import torch

from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_model import FastModel
from dfrf.field.field import Field
from dfrf.field.reference_views import ReferenceViews
from dfrf.field.warp import SLOPE
from tests.dfrf.people import person, small_config

POINT = torch.tensor([[0.1, -0.3, 0.8]])


def offset_by(field: Field, column: float, row: float) -> None:
    """Makes the warp the same everywhere, pixels at 512."""
    most = field.config.max_offset
    wanted = torch.tensor([column, row])
    with torch.no_grad():
        field.warp.out.weight.zero_()
        field.warp.out.bias.copy_(torch.atanh(wanted / most) * most / SLOPE)


def colour(views: ReferenceViews, column: float, row: float) -> torch.Tensor:
    """What a single reference shows of a point, warped."""
    torch.manual_seed(0)
    model = FastModel(small_config(references=1))
    offset_by(model.field, column, row)
    frame, directions = torch.zeros(1).long(), torch.tensor([[0.0, 0.0, -1.0]])
    with torch.no_grad():
        maps = model.field.encoder(views)
        conditioning = torch.zeros(1, model.config.field.cond_dim)
        query = model.field.query(POINT, directions, frame, conditioning)
        _, shown, offset = model.field.fuse_references(
            query, maps, conditioning, True, torch.zeros(1)
        )
    torch.testing.assert_close(offset[0, 0], torch.tensor([column, row]), atol=1e-4, rtol=1e-4)
    return shown[0]


@pytest.fixture
def ramps() -> ReferenceViews:
    """A reference whose red grows by 4 a column and whose green grows by 3 a row."""
    views = cut_references(person(), torch.tensor([2]))
    height, width = views.mattes.shape[1:]
    red = (4 * torch.arange(width)).expand(height, width)
    green = (3 * torch.arange(height))[:, None].expand(height, width)
    image = torch.stack([red, green, torch.zeros_like(red)], -1).to(torch.uint8)
    return replace(views, images=image[None])


@pytest.mark.parametrize(("column", "row"), [(12.0, 0.0), (-12.0, 0.0), (0.0, 12.0), (0.0, -12.0)])
def test_a_known_offset_reads_what_lies_there(
    ramps: ReferenceViews, column: float, row: float
) -> None:
    moved = colour(ramps, column, row) - colour(ramps, 0.0, 0.0)
    # 48 of 512 pixels: an offset of 12 at 512 is one of 1.125 pixels here.
    expected = torch.tensor([4 * column, 3 * row, 0.0]) * ramps.scale / 255
    torch.testing.assert_close(moved, expected, atol=1e-3, rtol=0)


def test_no_offset_is_larger_than_it_may_be() -> None:
    model = FastModel(small_config(references=1))
    with torch.no_grad():
        model.field.warp.out.bias.fill_(1e3)
    parts = torch.randn(5, 45), torch.zeros(1, 70), torch.ones(5, 1), torch.randn(1, 5, 12)
    most = model.config.field.max_offset
    torch.testing.assert_close(model.field.warp(*parts), torch.full((1, 5, 2), most))
