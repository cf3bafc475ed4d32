"""Views of a mouth: the right ones are looked at, where they show it, and nothing jumps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest
import torch
from torch import Tensor

from dfrf import device as devices
from dfrf import presets
from dfrf.data.dataset import HeadDataset
from dfrf.fast.fast_method import FastMethod
from dfrf.field import mouth_pixels
from dfrf.field.conditioned_field import ConditionedField
from dfrf.field.field import FieldOutput
from dfrf.field.mouth_pixels import fit_reading, nearest
from dfrf.field.reference_maps import ChosenMouths, ReferenceMaps
from dfrf.field.reference_views import MouthViews, ReferenceViews
from tests.dfrf.conftest import ROUNDING, forced
from tests.dfrf.people import lip_shape, person, small_config

FRAMES = 40


@dataclass(frozen=True)
class Someone:
    """A person whose lips open from the first frame to the last, seen from one place."""

    dataset: HeadDataset
    method: FastMethod
    maps: ReferenceMaps
    mouths: MouthViews

    def looked_at(
        self, measure: float, training_frame: int | None = None
    ) -> tuple[list[int], ChosenMouths]:
        """Which frames' mouths are looked at where lips have that measure."""
        assert self.maps.mouths is not None
        chosen = nearest(
            self.mouths,
            self.maps.mouths,
            torch.full((7,), measure),
            self.dataset.c2w[0, :, 3],
            None if training_frame is None else torch.tensor(training_frame),
        )
        return self.mouths.frames[chosen.maps.number].tolist(), chosen

    def seen(self, points: Tensor, conditioning: Tensor, **changes: object) -> FieldOutput:
        """The field at points in one frame, with the mouth views changed."""
        mouths = replace(self.mouths, **changes)  # type: ignore[arg-type]
        maps = replace(self.maps, views=replace(self.maps.views, mouths=mouths))
        field = ConditionedField(self.method.model.field, conditioning, maps)
        towards = torch.tensor([[0.0, 0.0, -1.0]]).expand(len(points), 3)
        origin = self.dataset.c2w[0, :, 3]
        with torch.no_grad(), devices.arithmetic(points.device):
            return field.seen_from(origin)(points, towards, torch.zeros(len(points)).long())


@pytest.fixture(scope="module", params=list(ROUNDING))
def someone(request: pytest.FixtureRequest) -> Iterator[Someone]:
    """In one arithmetic, then in the other."""
    with forced(request.param):
        yield made()


def made() -> Someone:
    below = -(lip_shape()[:, 1] - lip_shape()[:, 1].mean())
    opens = torch.linspace(0, 1, FRAMES)[:, None] * below
    measures = torch.linspace(-1.7, 1.7, FRAMES)[:, None].repeat(1, 7)
    dataset = person(FRAMES)
    dataset = replace(
        dataset,
        c2w=dataset.c2w[:1].repeat(FRAMES, 1, 1),
        lip_points=torch.stack([torch.zeros_like(opens), opens], -1),
        lips=measures,
    )
    torch.manual_seed(0)
    method = FastMethod(presets.build(small_config()).eval())
    maps = method.maps(method.reference_views(dataset, torch.tensor([0, 5])))
    assert maps.views.mouths is not None
    reading = fit_reading(measures, dataset.c2w, dataset.lip_points)
    return Someone(dataset, method, maps, replace(maps.views.mouths, reading=reading))


def test_a_frame_looks_at_the_mouths_most_like_the_one_wanted(someone: Someone) -> None:
    frames, chosen = someone.looked_at(float(someone.dataset.lips[20, 0]))
    assert all(abs(frame - 20) <= 3 for frame in frames)
    most = frames[int(chosen.maps.log_view_weight.argmax())]
    assert most in (19, 20, 21)
    assert max(someone.looked_at(-1.7)[0]) < 6


def test_a_frame_that_is_learned_sees_no_mouth_of_its_own_moment(someone: Someone) -> None:
    frames, _ = someone.looked_at(0.0, training_frame=20)
    assert all(abs(frame - 20) > mouth_pixels.NEIGHBOURS for frame in frames)


def test_weights_fade_before_another_mouth_takes_their_place(someone: Someone) -> None:
    rows = torch.zeros(401, FRAMES)
    for row, measure in zip(rows, torch.linspace(-1, 1, 401).tolist(), strict=True):
        frames, chosen = someone.looked_at(measure)
        row[frames] = chosen.maps.log_view_weight.exp()
    assert rows.argmax(1).unique().numel() > 15
    assert rows.diff(dim=0).abs().max() < 0.15


def first_views(mouths: MouthViews, count: int) -> ReferenceViews:
    """Crops in number, all seen from where the first one is."""
    views = mouths.views
    many = {name: getattr(views, name)[:1] for name in ("images", "mattes", "c2w", "centres")}
    return replace(views, **{k: t.repeat(count, *[1] * (t.dim() - 1)) for k, t in many.items()})


def test_mouths_count_by_the_fourth_power_of_their_nearness(someone: Someone) -> None:
    """(1 - r^2)^4 of the distance r from the lips wanted, 1 at the first mouth that is left out."""
    mouths, steps = someone.mouths, torch.tensor([0.0, 1, 2, 3, 4, 8, 9, 10])
    some = torch.arange(len(steps))
    views = first_views(mouths, len(steps))
    lips = steps[:, None, None] * torch.randn(1, mouths.lips.shape[1], 2)
    row = replace(mouths, views=views, lips=lips, frames=some, reading=0 * mouths.reading)
    assert someone.maps.mouths is not None
    origin = views.c2w[0, :, 3]
    chosen = nearest(row, someone.maps.mouths, torch.zeros(7), origin)
    assert chosen.maps.number.tolist() == [0, 1, 2, 3]
    by_hand = torch.tensor([1.0, (15 / 16) ** 4, (3 / 4) ** 4, (7 / 16) ** 4])
    torch.testing.assert_close(chosen.maps.log_view_weight.exp(), by_hand, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("apart", [0.1, 0.3])
def test_a_turn_counts_beside_lips_and_their_gap(someone: Someone, apart: float) -> None:
    """A frame's lips are 1 from the mean in the mean square, their gap 3 times; .15 rad are 1.

    Of a head that turns far, three quarters of its root mean square turn are.
    """
    mouths, angles = someone.mouths, apart * torch.arange(6)
    c2w = mouths.views.c2w[:1].repeat(len(angles), 1, 1)
    c2w[:, :, 3] = 7 * torch.stack([angles.sin(), 0 * angles, angles.cos()], 1)
    lips = 0.1 * torch.randn(len(angles), *mouths.lips.shape[1:])
    views = replace(first_views(mouths, len(angles)), c2w=c2w)
    row = replace(mouths, views=views, lips=lips, measured=lips, frames=20 * torch.arange(6))
    assert someone.maps.mouths is not None
    chosen = nearest(row, someone.maps.mouths, torch.zeros(7), c2w[1, :, 3], torch.tensor(1))
    # Frame 1 of those learned; the crops are of frames 0, 20 .. 100: the first lies beside it.
    spread = (lips - lips.mean(0)).square().sum((1, 2)).mean()
    gaps = mouth_pixels.gap(lips)
    squared = (lips - lips[1]).square().sum((1, 2)) / spread
    squared += 3 * (gaps - gaps[1]) ** 2 / (gaps - gaps.mean()).square().mean()
    from_middle = 2 * torch.sin((angles - angles.mean()) / 2)
    unit = max(0.15, 0.75 * float(from_middle.square().mean().sqrt()))
    assert (unit > 0.15) == (apart > 0.1)
    squared += (2 * torch.sin((angles - angles[1]) / 2) / unit) ** 2
    order = [k for k in squared.argsort().tolist() if k]
    assert chosen.maps.number.tolist() == order[:4]
    by_hand = (1 - squared[order[:4]] / squared[order[4]]) ** 4
    torch.testing.assert_close(chosen.maps.log_view_weight.exp(), by_hand, rtol=1e-3, atol=1e-3)


def test_lips_are_where_the_measures_say(someone: Someone) -> None:
    wanted = mouth_pixels.wanted_lips(
        someone.mouths, someone.dataset.lips[30], someone.dataset.c2w[0, :, 3]
    )
    torch.testing.assert_close(wanted, someone.dataset.lip_points[30], atol=2e-3, rtol=0)


def test_lips_that_touch_are_unlike_lips_that_hardly_do_not() -> None:
    """Of all that lips do the gap is little: a wide mouth that is closed is like a closed one."""
    lips = 0.05 * torch.randn(30, 40, 2, generator=torch.Generator().manual_seed(0))
    closed, wide, ajar = lips[:1].clone(), lips[:1].clone(), lips[:1].clone()
    wide[..., 0] *= 1.3
    ajar[:, mouth_pixels.LOWER_RIM, 1] += 0.03
    traits = mouth_pixels.lip_traits(torch.cat([closed, wide, ajar]), lips)
    apart = (traits[1:] - traits[0]).norm(dim=1)
    assert (ajar - closed).norm() < (wide - closed).norm()
    assert apart[1] > 1.5 * apart[0]


def test_lips_close_together_are_moved_apart() -> None:
    at = torch.tensor([[0.0, 0.0], [0.0, -0.02], [0.2, 0.0]])
    motion = torch.tensor([[[0.0, 3.0], [0.0, -3.0], [1.0, 0.0]]])
    weights = mouth_pixels.motion_weights(at, motion)
    made = mouth_pixels.gaussians(at, at) @ weights
    assert (made - motion).abs().max() < 0.6 * 3  # a mean of both would leave them where they are
    assert (made[0, 0, 1] - made[0, 1, 1]) > 0.4 * 6
    far = mouth_pixels.gaussians(at[:1] + 1.0, at) @ weights
    assert far.abs().max() < 1e-3


def test_a_lip_is_read_where_the_crop_shows_it(someone: Someone) -> None:
    _, chosen = someone.looked_at(0.0)
    shape = someone.mouths.shape
    at = torch.cat([chosen.at, shape[:, 2:]], 1)
    lips = someone.mouths.lips[chosen.maps.number]
    views = chosen.maps.views
    still = views.project(shape)
    middle, _ = mouth_pixels.region(shape)
    scale = views.focal / (views.c2w[:, :, 3] - middle).norm(dim=-1)
    seen = views.project(at) + mouth_pixels.moved(chosen, at)
    shown = still + lips * scale[:, None, None]
    before = (seen - mouth_pixels.moved(chosen, at) - shown).norm(dim=-1).mean()
    assert (seen - shown).norm(dim=-1).mean() < 0.4 * before


def test_the_choice_changes_the_mouth_and_nothing_else(someone: Someone) -> None:
    middle, reach = mouth_pixels.region(someone.mouths.shape)
    conditioning = torch.randn(1, 70, generator=torch.Generator().manual_seed(1))
    beside = (middle + 1.05 * reach * torch.tensor([0.0, 1.0, 0.0]))[None]
    points = torch.cat([someone.mouths.shape, beside])
    as_is = someone.seen(points, conditioning)
    closed = someone.seen(points, conditioning, reading=someone.mouths.reading + 0.1)
    assert (as_is.colour[:-1] - closed.colour[:-1]).abs().max() > 1e-4
    assert torch.equal(as_is.colour[-1], closed.colour[-1])


def test_what_a_mouth_is_read_off_fades_to_nothing(someone: Someone) -> None:
    middle, reach = mouth_pixels.region(someone.mouths.shape)
    line = middle + torch.linspace(0, 1.2, 200)[:, None] * reach * torch.tensor([1.0, 0.0, 0.0])
    maps = replace(someone.maps, chosen=(someone.looked_at(0.0)[1],))
    share = mouth_pixels.share(maps, line)
    assert (share[0], share[-1]) == (1, 0)
    assert share.diff().abs().max() < 0.04
    assert not mouth_pixels.share(someone.maps, line).any()  # none is looked at yet


def test_beside_the_mouth_no_colour_is_the_fields_own(someone: Someone) -> None:
    middle, reach = mouth_pixels.region(someone.mouths.shape)
    line = middle + torch.tensor([[0.0], [0.8], [1.0], [2.5]]) * reach * torch.tensor([1.0, 0, 0])
    conditioning = torch.zeros(1, 70)
    before = someone.seen(line, conditioning).colour
    bias = someone.method.model.field.colour.bias.data
    bias[:3] += 20  # white
    after = someone.seen(line, conditioning).colour
    bias[:3] -= 20
    torch.testing.assert_close(before[:3], after[:3])
    assert (after[3] - before[3]).min() > 0.05


@pytest.mark.parametrize("crops", [True, False])
def test_without_mouth_views_a_mouth_is_read_off_whole_references(crops: bool) -> None:
    someone, config = person(), small_config(mouth_views=crops)
    method = FastMethod(presets.build(config))
    views = method.reference_views(someone, torch.tensor([0, 5]))
    assert (views.mouths is not None) == crops
    conditioning = torch.zeros(1, config.field.cond_dim)
    field = ConditionedField(method.model.field, conditioning, method.maps(views))
    assert bool(field.chosen_mouths(someone.c2w[0, :, 3])) == crops


def test_of_many_frames_some_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    someone, method = person(), FastMethod(presets.build(small_config()))
    assert method.mouth_views(someone).frames.tolist() == [0, 1, 2, 3, 4, 5]
    monkeypatch.setattr("dfrf.fast.fast_method.MOST_COMPARED", 3)
    assert method.mouth_views(someone).frames.tolist() == [0, 2, 5]


def test_measures_are_read_off_lips(someone: Someone) -> None:
    """`read_measures` undoes `wanted_lips`."""
    mouths = someone.mouths
    generator = torch.Generator().manual_seed(0)
    reading = torch.randn(mouths.reading.shape, generator=generator)
    some = replace(mouths, reading=reading)
    measures, origin = torch.randn(3, 7, generator=generator), torch.tensor([0.3, -0.2, 7.0])
    lips = torch.stack([mouth_pixels.wanted_lips(some, m, origin) for m in measures])
    found = mouth_pixels.read_measures(some, lips, origin.expand(3, 3))
    torch.testing.assert_close(found, measures, atol=1e-3, rtol=1e-3)
