"""Poses that lay a known head on its own picture."""

import pytest
import torch

from dfrf import presets
from dfrf.cameras import Camera, pixel_grid
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_model import FastModel
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.frame_head import MarchedHead
from dfrf.rendering.frame_renderer import render_frame
from dfrf.rendering.pose_refinement import PoseObservation, moved, normal_equations
from tests.dfrf.people import FOCAL, SIZE, person, small_config

pytestmark = pytest.mark.medium


def fixed_model() -> tuple[FastModel, ReferenceMaps]:
    someone = person()
    torch.manual_seed(0)
    model = presets.build(small_config())
    with torch.no_grad():
        maps = model.field.encoder(cut_references(someone, torch.tensor([0, 5])))
    return model.eval(), maps


def test_a_camera_moves_about_the_head() -> None:
    c2w = person().c2w[:2]
    turn = torch.tensor([0.0, torch.pi / 2, 0.0, 0.0, 0.0, 0.5])
    there = moved(c2w, turn)
    # A quarter turn about y takes z to x; then the shift along z.
    torch.testing.assert_close(there[0, :, 3], torch.tensor([7.0, 0.0, 0.4 + 0.5]))
    torch.testing.assert_close(there[1, :, 2], torch.tensor([1.0, 0.0, 0.0]), atol=1e-6, rtol=0)
    torch.testing.assert_close(moved(c2w, torch.zeros(2, 6)), c2w)
    small = 0.004 * torch.tensor([1.0, -1, 1, -1, 1, -1])
    back = moved(moved(c2w, small), -small)
    torch.testing.assert_close(back, c2w, atol=2e-4, rtol=0)


def test_steps_find_the_camera_that_a_picture_was_taken_with() -> None:
    model, maps = fixed_model()
    someone = person()
    true, centre, conditioning = someone.c2w[3], someone.centres[3], torch.zeros(1, 70)
    colour, opacity = render_frame(
        model.volume(conditioning, maps), Camera(true, FOCAL, centre, SIZE)
    )
    behind = torch.full((SIZE, SIZE, 3), 90 / 255)
    picture = colour + (1 - opacity[..., None]) * behind
    inside = torch.zeros(SIZE, SIZE, dtype=torch.bool)
    inside[4:-4, 4:-4] = True
    pixels = pixel_grid(SIZE, SIZE)[inside]
    observation = PoseObservation(pixels, picture[inside], behind[inside], FOCAL, centre)
    wrong = torch.tensor([0.01, -0.02, 0.015, 0.02, -0.015, 0.03])
    camera = moved(true, wrong)

    def off(camera: torch.Tensor) -> float:
        # By how much points round the head land elsewhere, in pixels.
        points = torch.tensor(
            [[0.6, 0.3, 0.5], [-0.6, 0.3, 0.5], [0.0, 1.0, 0.3], [0.0, -0.5, 0.9]]
        )

        def seen(c2w: torch.Tensor) -> torch.Tensor:
            local = (points - c2w[:, 3]) @ c2w[:, :3]
            return FOCAL * local[:, :2] / local[:, 2:]

        return float((seen(camera) - seen(true)).norm(dim=-1).mean())

    before = off(camera)
    for _ in range(6):
        left, right = normal_equations(
            MarchedHead(model.volume(conditioning, maps)), observation, camera
        )
        assert torch.linalg.eigvalsh(left).min() > -1e-4 * left.abs().max()
        camera = moved(camera, torch.linalg.solve(left + 1e-3 * torch.eye(6), right))
    assert before > 0.3
    assert off(camera) < 0.2 * before


def test_what_the_head_does_not_explain_has_little_say() -> None:
    model, maps = fixed_model()
    someone = person()
    true, centre, conditioning = someone.c2w[3], someone.centres[3], torch.zeros(1, 70)
    pixels = pixel_grid(SIZE, SIZE)[10:30, 10:30].reshape(-1, 2)
    behind = torch.zeros(len(pixels), 3)
    observation = PoseObservation(pixels, torch.ones(len(pixels), 3) * 5, behind, FOCAL, centre)
    left, right = normal_equations(MarchedHead(model.volume(conditioning, maps)), observation, true)
    plain = PoseObservation(pixels, torch.zeros(len(pixels), 3), behind, FOCAL, centre)
    black, _ = normal_equations(MarchedHead(model.volume(conditioning, maps)), plain, true)
    assert left.diagonal().sum() < 1e-3 * black.diagonal().sum()
    assert right.isfinite().all()


def test_a_frame_without_pixels_says_nothing() -> None:
    model, maps = fixed_model()
    someone = person()
    none = torch.zeros(0, 2), torch.zeros(0, 3), torch.zeros(0, 3)
    observation = PoseObservation(*none, FOCAL, someone.centres[3])
    left, right = normal_equations(
        MarchedHead(model.volume(torch.zeros(1, 70), maps)), observation, someone.c2w[3]
    )
    assert not left.any()
    assert not right.any()
