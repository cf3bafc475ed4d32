"""That shapes in signatures are really checked while these tests run (see tests/shapes.py)."""

import pytest
import torch
from jaxtyping import TypeCheckError

from dfrf.cameras import pixel_rays, project
from dfrf.published.volume_rendering import composite


def test_sizes_of_one_name_must_agree() -> None:
    composite(torch.rand(2, 3, 3), torch.rand(2, 3), torch.rand(2, 3))
    with pytest.raises(TypeCheckError, match="opacity"):
        composite(torch.rand(2, 4, 3), torch.rand(2, 3), torch.rand(2, 3))
    with pytest.raises(TypeCheckError, match="distances"):
        composite(torch.rand(2, 3, 3), torch.rand(2, 3), torch.rand(2, 4))


def test_unions_are_looked_into() -> None:
    camera, centre = torch.eye(3, 4).repeat(2, 1, 1), torch.zeros(2, 2)
    project(torch.rand(5, 3), camera, 10.0, centre)
    project(torch.rand(5, 3), camera, torch.ones(2), centre)
    with pytest.raises(TypeCheckError, match="focal"):
        project(torch.rand(5, 3), camera, torch.ones(3), centre)


def test_kinds_of_numbers_are_looked_at() -> None:
    with pytest.raises(TypeCheckError, match="points"):
        project(torch.ones(5, 3).long(), torch.eye(3, 4)[None], 10.0, torch.zeros(1, 2))


def test_leading_shapes_broadcast() -> None:
    camera, centre = torch.eye(3, 4), torch.zeros(2)
    assert pixel_rays(camera, 5.0, centre, torch.rand(6, 7, 2))[0].shape == (6, 7, 3)
