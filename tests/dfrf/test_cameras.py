import pytest
import torch
from torch import Tensor
from torch.autograd import gradcheck

from dfrf.cameras import pixel_grid, pixel_rays, project


def cameras(count: int, seed: int = 0) -> Tensor:
    """Random rigid cameras about a unit from the origin, looking towards it."""
    generator = torch.Generator().manual_seed(seed)
    tilt = 0.3 * torch.randn(count, 3, generator=generator, dtype=torch.float64)
    skew = torch.zeros(count, 3, 3, dtype=torch.float64)
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = tilt.unbind(-1)
    rotation = torch.linalg.matrix_exp(skew - skew.transpose(1, 2))
    return torch.cat([rotation, rotation @ torch.tensor([[0.0], [0.0], [1.0]]).double()], -1)


def test_a_point_by_hand() -> None:
    camera = torch.tensor([[[1.0, 0, 0, 0.1], [0, 1, 0, -0.2], [0, 0, 1, 2.0]]])
    # In the camera: (0.4, 0.7, -2), so column 32 + 100 * 0.4 / 2 and row 24 - 100 * 0.7 / 2.
    seen = project(torch.tensor([0.5, 0.5, 0.0]), camera, 100.0, torch.tensor([[32.0, 24.0]]))
    torch.testing.assert_close(seen, torch.tensor([[52.0, -11.0]]))


def test_projection_against_a_loop_with_a_focal_and_a_centre_for_each_view() -> None:
    c2w = cameras(3)
    points = 0.2 * torch.randn(2, 5, 3, dtype=torch.float64)
    focal = torch.tensor([100.0, 150.0, 80.0], dtype=torch.float64)
    centre = torch.tensor([[32.0, 31.0], [10.0, 50.0], [0.0, 1.0]], dtype=torch.float64)
    seen = project(points, c2w, focal, centre)
    assert seen.shape == (3, 2, 5, 2)
    for n in range(3):
        w2c = torch.linalg.inv(torch.cat([c2w[n], c2w.new_tensor([[0, 0, 0, 1]])]))
        for i in range(2):
            for j in range(5):
                x, y, z, _ = (w2c @ torch.cat([points[i, j], c2w.new_ones(1)])).tolist()
                f, (cx, cy) = focal[n].item(), centre[n].tolist()
                expected = c2w.new_tensor([cx - f * x / z, cy + f * y / z])
                torch.testing.assert_close(seen[n, i, j], expected)


def test_positions_are_exact_where_products_are_rounded() -> None:
    c2w, points = cameras(3).float(), 0.2 * torch.randn(50, 3)
    centre = c2w.new_full((3, 2), 200.0)
    exact = project(points, c2w, 1000.0, centre)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        torch.testing.assert_close(project(points, c2w, 1000.0, centre), exact)


def test_rays_project_back_to_their_pixels() -> None:
    c2w = cameras(4)
    centre = torch.tensor([[8.0, 9.0], [7.0, 7.0], [4.0, 12.0], [8.0, 8.0]], dtype=torch.float64)
    pixels = pixel_grid(16, 12).reshape(-1, 2).double()
    for n in range(4):
        origins, directions = pixel_rays(c2w[n], 20.0, centre[n], pixels)
        points = origins + 0.7 * directions
        back = project(points, c2w[n : n + 1], 20.0, centre[n : n + 1])[0]
        torch.testing.assert_close(back, pixels)
        along = -(directions @ c2w[n, :, 2])
        torch.testing.assert_close(along, torch.ones_like(along))


def test_a_camera_for_each_ray_equals_one_after_another() -> None:
    c2w, focal = cameras(3), torch.tensor([10.0, 20.0, 30.0], dtype=torch.float64)
    centre, pixels = torch.randn(2, 3, 2, dtype=torch.float64)
    origins, directions = pixel_rays(c2w, focal, centre, pixels)
    for n in range(3):
        one = pixel_rays(c2w[n], focal[n], centre[n], pixels[n])
        torch.testing.assert_close((origins[n], directions[n]), one)


def test_pixel_grid_is_column_row() -> None:
    grid = pixel_grid(3, 4)
    assert grid.shape == (3, 4, 2)
    assert grid[2, 1].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("depth", [0.0, 1e-9])
def test_a_point_in_the_plane_of_the_camera_stays_finite(depth: float) -> None:
    camera = torch.eye(3, 4)[None]
    point = torch.tensor([0.0, 0.1, depth], requires_grad=True)
    seen = project(point, camera, 10.0, torch.zeros(1, 2))
    seen.sum().backward()
    assert seen.isfinite().all()
    assert point.grad is not None
    assert point.grad.isfinite().all()


def test_gradient() -> None:
    c2w, centre = cameras(2), torch.zeros(2, 2, dtype=torch.float64)
    points = (0.2 * torch.randn(4, 3, dtype=torch.float64)).requires_grad_()
    assert gradcheck(lambda p: project(p, c2w, 30.0, centre), points)
