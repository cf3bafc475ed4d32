"""Brows: where skin moves, how far, and that a field sees a raised brow as the lower one moved."""

from dataclasses import replace

import torch

from dfrf.data import cut_references
from dfrf.fast.method import FastMethod
from dfrf.fast.model import FastModel
from dfrf.field import brow_deformation
from dfrf.field.reference_maps import ReferenceViews
from dfrf.field.speaker_adaptation import extended
from tests.dfrf.people import person, small_config

LEFT, RIGHT, LID, BACK = (
    torch.tensor([p])
    for p in ([-0.42, 0.5, 0.65], [0.42, 0.5, 0.65], [0.35, 0.29, 0.55], [0.42, 0.5, -0.8])
)


def test_each_brow_moves_its_own_skin_and_nothing_else() -> None:
    share = brow_deformation.motion_weights(torch.cat([LEFT, RIGHT, LID, BACK]))
    torch.testing.assert_close(share, torch.tensor([[1.0, 0], [0, 1], [0, 0], [0, 0]]))
    middle = brow_deformation.motion_weights(torch.tensor([[0.0, 0.5, 0.7]]))
    torch.testing.assert_close(middle, torch.tensor([[0.5, 0.5]]))


def test_a_measure_of_one_is_three_hundredths_of_the_distance_between_the_eyes() -> None:
    lift = brow_deformation.lifts(brow_deformation.motion_weights(LEFT), torch.tensor([[2.0, 5.0]]))
    torch.testing.assert_close(lift, torch.tensor([2 * 0.03 * 0.9]))
    moved = brow_deformation.lowered(LEFT, lift)
    torch.testing.assert_close(moved, LEFT - torch.tensor([[0.0, 0.054, 0.0]]))


def test_skin_does_not_fold() -> None:
    height = torch.linspace(0, 1.2, 200)
    column = torch.stack([torch.full_like(height, 0.4), height, torch.full_like(height, 0.6)], -1)
    for measure in (-9.0, 9.0):
        lift = brow_deformation.lifts(
            brow_deformation.motion_weights(column), torch.full((1, 2), measure)
        )
        assert (brow_deformation.lowered(column, lift)[:, 1].diff() > 0).all()


def test_a_raised_brow_is_the_same_brow_further_up() -> None:
    model = FastModel(small_config(references=0, use_warp=False))
    field, code = model.field, model.config.field.code_dim
    with torch.no_grad():
        # What a field makes of the measure beyond the motion of the skin.
        field.input_conditioning.weight[:, code:] = 0
    towards = torch.tensor([[0.0, 0.0, -1.0]])
    calm, raised = torch.zeros(1, code + 6), torch.zeros(1, code + 6)
    raised[:, code + 3] = 3.0
    up = torch.tensor([[0.0, 3 * 0.03 * 0.9, 0.0]])
    frame = torch.zeros(1, dtype=torch.long)
    before = field(RIGHT, towards, frame, calm, None)
    after = field(RIGHT + up, towards, frame, raised, None)
    torch.testing.assert_close(after.density, before.density)
    torch.testing.assert_close(after.colour, before.colour)
    assert not torch.allclose(field(RIGHT + up, towards, frame, calm, None).colour, before.colour)


def test_a_reference_is_looked_up_where_its_own_brow_is() -> None:
    # The same brow in both: it is seen at the same place of the reference, wherever it is.
    model, someone = FastModel(small_config(use_warp=False)), person()
    views = cut_references(someone, torch.tensor([0, 1, 2, 3]))
    maps = model.field.encoder(views)
    conditioning = torch.zeros(1, model.config.field.cond_dim)
    towards, frame = torch.tensor([[0.0, 0.0, -1.0]]), torch.zeros(1, dtype=torch.long)
    with torch.no_grad():
        model.field.input_conditioning.weight.zero_()
        model.field.aggregation.conditioning.weight.zero_()
    plain = model.field(
        LEFT, towards, frame, conditioning, replace(maps, views=at_height(views, 0.0))
    )
    conditioning[:, model.config.field.code_dim + 2] = 2.0
    up = torch.tensor([[0.0, 2 * 0.03 * 0.9, 0.0]])
    # A raised brow before references that are not raised shows what the lower one showed.
    moved = model.field(
        LEFT + up, towards, frame, conditioning, replace(maps, views=at_height(views, 0.0))
    )
    torch.testing.assert_close(moved.colour, plain.colour, atol=0.01, rtol=0)
    other = model.field(
        LEFT, towards, frame, conditioning, replace(maps, views=at_height(views, 0.0))
    )
    assert (other.colour - plain.colour).abs().max() > (moved.colour - plain.colour).abs().max()


def at_height(views: ReferenceViews, measure: float) -> ReferenceViews:
    """The views with all brows as high as a measure says."""
    return replace(views, expression=torch.full((len(views.c2w), 6), measure))


def test_brows_go_no_further_than_they_usually_did_and_nothing_else_is_held() -> None:
    someone = person(frames=40)
    upper = torch.randn(40, 6, generator=torch.Generator().manual_seed(2))
    upper[7, brow_deformation.MEASURES], upper[9, brow_deformation.MEASURES] = 9.0, -9.0
    config = small_config()
    model = FastModel(replace(config, field=replace(config.field, references=0, use_warp=False)))
    FastMethod(model).finish(replace(someone, expression=upper), None, 0)
    low, high = brow_deformation.brow_range(upper[:, brow_deformation.MEASURES])
    assert -4 < low.min() <= low.max() <= -1
    assert 1 <= high.min() <= high.max() < 4
    with torch.no_grad():
        predicted = extended(someone.predicted_lips)
        conditioning = model.field.conditioning(torch.zeros(40, 8, 16, 8), predicted, upper)
    conditioning = conditioning[:, -6:]
    torch.testing.assert_close(conditioning[7, brow_deformation.MEASURES], high)
    torch.testing.assert_close(conditioning[9, brow_deformation.MEASURES], low)
    inside = (
        (upper[:, brow_deformation.MEASURES] > low) & (upper[:, brow_deformation.MEASURES] < high)
    ).all(1)
    assert inside.sum() > 25
    torch.testing.assert_close(conditioning[inside], upper[inside])
    torch.testing.assert_close(conditioning[:, :2], upper[:, :2])
    torch.testing.assert_close(conditioning[:, 4:], upper[:, 4:])


def test_a_brow_that_hardly_moved_may_still_move() -> None:
    still = torch.linspace(-0.7, -0.4, 50)[:, None].repeat(1, 2)
    torch.testing.assert_close(
        brow_deformation.brow_range(still), torch.tensor([[-1.0, -1], [1, 1]])
    )
