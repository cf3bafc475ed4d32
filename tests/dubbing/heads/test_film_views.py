"""A head reads views of the film it is put into, beside those it was learned from."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dfrf import saved_models
from dfrf.checkpoint import CheckpointError
from dfrf.data.reference_cuts import cut_mouths_like, cut_references_like
from dfrf.fast.fast_method import FastMethod
from dfrf.field.reference_views import ReferenceViews
from dubbing.heads.film_views import NEW, WHOLE, joined, new_viewpoints
from tests.dfrf.people import person, random_model


def learned() -> ReferenceViews:
    model, _ = random_model()
    found = FastMethod(model).finish(person(), torch.tensor([0, 5]), seed=0)
    assert found is not None
    return found


def turned(degrees: list[float]) -> torch.Tensor:
    """Cameras (T, 3, 4) round the head."""
    angle = torch.tensor(degrees).deg2rad()
    c2w = torch.zeros(len(angle), 3, 4)
    c2w[:, 0, 3], c2w[:, 2, 3] = 7 * angle.sin(), 7 * angle.cos()
    return c2w


def test_views_are_taken_from_where_none_was_learned() -> None:
    film = turned([0, 3, -4, 20, 24, 45, 47, -60])
    chosen = new_viewpoints(film, turned([-5, 5])).tolist()
    assert {0, 1, 2}.isdisjoint(chosen)
    angles = film[chosen, 0, 3].div(7).asin().rad2deg()
    assert len(chosen) == 3  # one of 20 and 24, one of 45 and 47, and -60
    assert (torch.pdist(angles[:, None]) > np.degrees(NEW) - 1).all()
    assert not len(new_viewpoints(turned([1, 2]), turned([0])))
    assert len(new_viewpoints(turned(list(range(-90, 90, 3))), turned([0]))) <= WHOLE


def test_crops_of_the_same_frames_are_the_same_crops() -> None:
    views = learned()
    assert views.mouths is not None
    crops = cut_mouths_like(person(), views.mouths.frames, views.mouths)
    assert crops.views.images.shape == views.mouths.views.images.shape
    middle = views.mouths.shape.mean(0, keepdim=True)
    ours, theirs = crops.views, views.mouths.views
    a, b = (v.project(middle)[:, 0].round().long() for v in (ours, theirs))
    for n, (x, y) in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        assert ours.images[n, x[1], x[0]].equal(theirs.images[n, y[1], y[0]])


def test_a_film_may_have_no_new_viewpoint() -> None:
    none = cut_references_like(person(), torch.zeros(0, dtype=torch.long), learned())
    assert none.images.shape == (0, *learned().images.shape[1:])


def test_learned_views_and_those_of_the_film_are_one_set() -> None:
    ours = learned()
    assert ours.mouths is not None
    theirs = cut_references_like(person(), torch.tensor([3]), ours)
    theirs = replace(
        theirs,
        surface=torch.ones(1, *ours.surface.shape[1:]) if ours.surface is not None else None,
        mouths=cut_mouths_like(person(), torch.tensor([1, 2]), ours.mouths),
    )
    both = joined(ours, theirs)
    assert both.mouths is not None
    assert len(both.c2w) == 3
    assert len(both.mouths.lips) == len(ours.mouths.lips) + 2
    assert both.c2w[-1].equal(theirs.c2w[0])
    assert both.images.shape[1:] == ours.images.shape[1:]


def test_they_are_kept_in_a_file(tmp_path: Path) -> None:
    path, views = tmp_path / "views.safetensors", learned()
    saved_models.save_views(path, views)
    kept = saved_models.load_views(path)
    assert kept is not None
    assert kept.images.equal(views.images)
    assert kept.surface is not None
    assert views.surface is not None
    assert kept.surface.equal(views.surface)
    saved_models.save_views(path, None)
    assert saved_models.load_views(path) is None
    path.write_bytes(b"nothing")
    with pytest.raises(CheckpointError):
        saved_models.load_views(path)
