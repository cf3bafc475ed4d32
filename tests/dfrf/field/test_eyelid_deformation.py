"""Lids: a shut eye is read off the reference's upper lid, and the eye itself stays where it is."""

from dataclasses import replace

import torch
from torch import Tensor

from dfrf.data import cut_references
from dfrf.fast.model import FastModel
from dfrf.field import brow_deformation, eyelid_deformation
from dfrf.training.augmentation import mirror
from tests.dfrf.people import person, small_config

LINE, LOWER, END, REST = 0.28, 0.03, 0.145, 0.09
EYES = torch.tensor(
    [[-0.46, LINE, -0.16, LINE, LOWER, END, REST], [0.16, LINE, 0.46, LINE, LOWER, END, REST]]
)
OPEN = torch.zeros(1, 2)
# As far as measures go down where FaceMesh finds the eye 0.02 eye distances open.
CLOSED = (
    OPEN
    + (eyelid_deformation.CLOSED - REST) / brow_deformation.EYE_DISTANCE / eyelid_deformation.LENGTH
)


def column(x: float = 0.31, count: int = 200) -> Tensor:
    """Points one above the other through the middle of an eye, (count, 3)."""
    height = torch.linspace(LINE - 2 * LOWER, LINE + 2 * END, count)
    return torch.stack([torch.full_like(height, x), height, torch.full_like(height, 0.6)], -1)


def read(points: Tensor, own: Tensor, theirs: Tensor) -> Tensor:
    """The heights (M,) at which one reference shows points."""
    return points[:, 1] - eyelid_deformation.lifts(points[None], EYES, own, theirs)[0]


def test_a_reference_with_the_same_lids_is_read_where_the_points_are() -> None:
    points = column()
    for measure in (-2.0, 0.0, 0.7):
        same = torch.full((1, 2), measure)
        torch.testing.assert_close(read(points, same, same), points[:, 1])


def test_a_shut_eye_shows_the_upper_lid_and_nothing_of_the_eye() -> None:
    points = column()
    rim = LINE - LOWER + REST
    edge = LINE - LOWER
    over = (points[:, 1] > edge + eyelid_deformation.RIM / 2) & (points[:, 1] < LINE + END)
    under = (points[:, 1] < edge - eyelid_deformation.RIM / 2) | (points[:, 1] > LINE + END)
    found = read(points, CLOSED, OPEN)
    assert (found[over] > rim).all()
    assert (found[over] < LINE + END).all()
    assert (found.diff() > 0).all()
    # Skin is stretched evenly, and neither folds nor moves beyond the end of the motion.
    assert (found[over].diff() > 0).all()
    torch.testing.assert_close(found[over].diff(), found[over].diff()[:1].expand(sum(over) - 1))
    torch.testing.assert_close(found[under], points[under, 1])


def test_half_a_blink_hides_the_upper_half_of_the_eye_and_leaves_the_lower() -> None:
    half = CLOSED / 2
    points, opening = column(), float(eyelid_deformation.openings(EYES, half)[0, 1])
    assert abs(opening - REST / 2) < 1e-3
    rim = LINE - LOWER + opening
    below, above = (
        (points[:, 1] < rim - eyelid_deformation.RIM / 2),
        (points[:, 1] > rim + eyelid_deformation.RIM / 2),
    )
    found = read(points, half, OPEN)
    torch.testing.assert_close(found[below], points[below, 1])
    assert (found[above] > LINE - LOWER + REST - 1e-3).all()


def test_an_eye_wider_than_the_references_is_all_of_the_eye_there_is() -> None:
    points = column()
    found = read(points, OPEN, CLOSED / 2)
    inside = (points[:, 1] > LINE - LOWER) & (points[:, 1] < LINE - LOWER + REST - 1e-3)
    assert (found[inside] < LINE - LOWER + REST / 2).all()
    assert (found.diff() > 0).all()


def test_each_eye_follows_its_own_lids_and_corners_do_not_move() -> None:
    wink = torch.stack([CLOSED[:, 0], OPEN[:, 1]], 1)
    left, right = column(-0.31), column(0.31)
    torch.testing.assert_close(read(right, wink, OPEN), right[:, 1])
    assert (read(left, wink, OPEN) - left[:, 1]).abs().max() > 0.08
    for x in (-0.47, -0.46, -0.16, 0.0, 0.16, 0.46, 0.5):
        torch.testing.assert_close(read(column(x), CLOSED, OPEN), column(x)[:, 1])


def test_only_points_round_the_eyes_are_lifted_and_as_by_all_points() -> None:
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(4000, 3, generator=generator) * 2 - 1
    own = torch.randn(4000, 2, generator=generator)
    theirs = torch.randn(3, 2, generator=generator)
    lift = 0.05 * torch.randn(3, 4000, generator=generator) * (points[:, 1] > 0.3)
    skin = brow_deformation.lowered(points.expand(3, -1, -1), lift)
    expected = lift + eyelid_deformation.lifts(skin, EYES, own, theirs)
    eyelid_deformation.add_lifts(
        lift, points, eyelid_deformation.points_near_eyes(points, EYES), EYES, own, theirs
    )
    front = points[:, 2] > brow_deformation.FRONT
    near = (points[:, 1] < LINE + END + eyelid_deformation.BESIDE) & (points[:, 1] > LINE - LOWER)
    torch.testing.assert_close(lift[:, front & near], expected[:, front & near])


def test_a_mirrored_person_has_mirrored_lids() -> None:
    eyes = EYES + 0.01 * torch.arange(14).view(2, 7)
    points, measures = torch.cat([column(-0.3), column(0.25)]), torch.tensor([[-2.0, -0.5]])
    expected = eyelid_deformation.lifts(points[None], eyes, measures, OPEN)
    found = eyelid_deformation.lifts(
        mirror(points)[None], eyelid_deformation.mirrored(eyes), measures.flip(1), OPEN
    )
    torch.testing.assert_close(found, expected)
    torch.testing.assert_close(eyelid_deformation.mirrored(eyelid_deformation.mirrored(eyes)), eyes)


def test_a_field_shows_the_lid_of_the_references_where_an_eye_is_shut() -> None:
    torch.manual_seed(0)
    model, someone = FastModel(small_config(use_warp=False)), person()
    views = cut_references(someone, torch.tensor([0, 1, 2, 3]))
    views = replace(views, eyes=EYES, expression=torch.zeros(4, 6))
    maps = replace(model.field.encoder(views), views=views)
    points = column()[60:120]
    towards = torch.tensor([[0.0, 0.0, -1.0]]).expand(len(points), -1)
    frame = torch.zeros(len(points), dtype=torch.long)
    conditioning = torch.zeros(1, model.config.field.cond_dim)
    conditioning[:, model.config.field.code_dim :][:, eyelid_deformation.MEASURES] = CLOSED
    with torch.no_grad():
        moved = points.clone()
        moved[:, 1] = read(points, CLOSED, OPEN)
        shut = model.field(points, towards, frame, conditioning, maps)
        lid = model.field(moved, towards, frame, torch.zeros_like(conditioning), maps)
        eye = model.field(points, towards, frame, torch.zeros_like(conditioning), maps)
    # All that is left is the direction each place is seen in.
    assert (shut.colour - lid.colour).abs().mean() < 0.1 * (eye.colour - lid.colour).abs().mean()


def test_a_view_of_shut_eyes_is_read_where_a_lid_is_shut_and_nowhere_else() -> None:
    points = torch.cat([column(-0.31), column(0.31), torch.tensor([[0.0, LINE, 0.6]])])
    at = torch.arange(len(points))
    assert not eyelid_deformation.closed_eye_weights(points, at, EYES, OPEN).any()
    wink = torch.stack([OPEN[:, 0], CLOSED[:, 1]], 1)
    share = eyelid_deformation.closed_eye_weights(points, at, EYES, wink)
    assert not share[:200].any()
    assert not share[-1].any()
    height = points[200:400, 1]
    lid = (height > LINE - LOWER) & (
        height < LINE - LOWER + (1 - eyelid_deformation.SOFT) * (END + LOWER)
    )
    torch.testing.assert_close(share[200:400][lid], torch.ones(int(lid.sum())))
    assert not share[200:400][
        (height > LINE + END) | (height < LINE - LOWER - eyelid_deformation.BELOW)
    ].any()
    assert share[200:400].diff().abs().max() < 0.1


def test_of_half_a_blink_the_lid_is_read_off_it_and_the_eye_is_not() -> None:
    points, half = column(), CLOSED * 0.48
    share = eyelid_deformation.closed_eye_weights(points, torch.arange(len(points)), EYES, half)
    rim = LINE - LOWER + float(eyelid_deformation.openings(EYES, half)[0, 1])
    above, below = points[:, 1] > rim + 1e-3, points[:, 1] < rim - 1e-3
    assert share[above].max() > 0.6
    assert not share[below].any()


def test_the_frame_of_shut_eyes_is_one_where_both_are_shut_in_the_most_usual_pose() -> None:
    measures = torch.cat([OPEN, CLOSED, CLOSED / 2, CLOSED, OPEN])
    measures[1, 0] = 0
    forward = torch.tensor([[0.0, 0, 1]]).repeat(5, 1)
    assert eyelid_deformation.closed_eye_frame(EYES, measures, forward) == 3
    measures[4] = CLOSED
    forward[3, 0] = 0.3
    assert eyelid_deformation.closed_eye_frame(EYES, measures, forward) == 4
    assert eyelid_deformation.closed_eye_frame(EYES, measures[:3], forward[:3]) is None


def test_a_person_who_blinks_has_a_view_of_it_and_one_who_does_not_has_none() -> None:
    someone = person()
    someone.expression[:, eyelid_deformation.MEASURES] = 0
    frames = torch.tensor([1, 4])
    assert cut_references(someone, frames).blinks == 0
    someone.expression[2, eyelid_deformation.MEASURES] = -2.0
    views = cut_references(someone, frames)
    assert views.blinks == 1
    assert torch.equal(views.c2w, someone.c2w[torch.tensor([1, 4, 2])])
    assert cut_references(someone, frames, exclude=torch.tensor([2, 3])).blinks == 0
    someone.expression[5, eyelid_deformation.MEASURES] = -2.0
    others = cut_references(someone, frames, exclude=torch.tensor([2, 3]))
    assert torch.equal(others.c2w, someone.c2w[torch.tensor([1, 4, 5])])


def test_a_shut_lid_has_the_colours_of_the_blink_and_an_open_one_those_of_the_faces() -> None:
    torch.manual_seed(0)
    model, someone = FastModel(small_config(use_warp=False)), person()
    someone = replace(someone, eyes=EYES, expression=torch.zeros(6, 6))
    someone.expression[2, eyelid_deformation.MEASURES] = CLOSED
    views = cut_references(someone, torch.tensor([0, 1]))
    points = column()[25:80]  # up to where the lid goes over into its surroundings
    towards = torch.tensor([[0.0, 0.0, -1.0]]).expand(len(points), -1)
    frame = torch.zeros(len(points), dtype=torch.long)

    @torch.no_grad()
    def colour(measure: Tensor, black: slice) -> Tensor:
        images = views.images.clone()
        images[black] = 0
        maps = model.field.encoder(replace(views, images=images))
        conditioning = torch.zeros(1, model.config.field.cond_dim)
        conditioning[:, model.config.field.code_dim :][:, eyelid_deformation.MEASURES] = measure
        return model.field(points, towards, frame, conditioning, maps).colour

    nothing = slice(0, 0)
    for measure, read_off, rest in (
        (CLOSED, views.closed_eyes, views.faces),
        (OPEN, views.faces, views.closed_eyes),
    ):
        whole = colour(measure, nothing)
        torch.testing.assert_close(colour(measure, rest), whole, atol=1e-5, rtol=0)
        assert (colour(measure, read_off) - whole).abs().min() > 0.1
