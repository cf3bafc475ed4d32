"""Flicker of a plate with known grey values that moves with known poses."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dubbing.face.mesh_points import BROWS_AND_BRIDGE, LEFT_LIDS, RIGHT_LIDS
from dubbing.preparation.alignment.camera import rotation_from_vector
from dubbing.preparation.alignment.skin import Skin
from dubbing.preparation.prepared import PreparedClip
from dubbing.workshop.lab.flicker import Flicker, brow_skin

pytestmark = pytest.mark.medium


FRAMES, SIZE, FOCAL = 8, 96, 450.0


@pytest.fixture
def clip(tmp_path: Path) -> PreparedClip:
    """A head that keeps still before the camera."""
    return PreparedClip(
        folder=tmp_path,
        clip=tmp_path / "clip.mp4",
        rate=Fraction(25),
        frames_count=FRAMES,
        part=(0, FRAMES),
        size=SIZE,
        source_size=(SIZE, SIZE),
        focal=FOCAL,
        near=5.0,
        far=9.0,
        warnings=[],
        face_warnings=[],
        residual_shift=0.0,
        rotation=np.tile(np.eye(3), (FRAMES, 1, 1)),
        translation=np.tile([0.0, 0.0, 7.0], (FRAMES, 1)),
        centre=np.full((FRAMES, 2), SIZE / 2),
        crop=np.tile([0.0, 0.0, SIZE, 0.0], (FRAMES, 1)),
        valid=np.ones(FRAMES, bool),
        detected=np.ones(FRAMES, bool),
        covered=np.zeros(FRAMES, bool),
        over=np.zeros(FRAMES, bool),
        shown=np.ones(FRAMES, np.float32),
        haze=np.zeros((FRAMES, 3)),
        noise=np.zeros((FRAMES, 5)),
        segment=np.zeros(FRAMES, int),
        landmarks=np.zeros((FRAMES, 478, 2)),
        lip_shift=np.zeros((FRAMES, 40, 2)),
        shape=np.zeros((478, 3)),
    )


@pytest.fixture
def plate() -> Skin:
    """Points of the plane z = 0 of the head frame, which face the camera."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 23), np.linspace(-0.4, 0.4, 23))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
    return Skin(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)))


def flat(grey: float) -> np.ndarray:
    return np.full((SIZE, SIZE, 3), grey, np.uint8)


def figures(
    clip: PreparedClip, plate: Skin, renders: list[np.ndarray], sources: list[np.ndarray]
) -> dict[str, float]:
    flicker = Flicker(clip, plate)
    for k, (render, source) in enumerate(zip(renders, sources, strict=True)):
        flicker.add(k, render, source)
    return flicker.figures()


def seen(clip: PreparedClip, frame: int) -> np.ndarray:
    """The textured plate as the camera sees it, (S, S, 3) uint8."""
    rows, columns = np.mgrid[:SIZE, :SIZE]
    centre = clip.centre[frame]
    ray = np.stack(
        [(columns - centre[0]) / FOCAL, (rows - centre[1]) / FOCAL, np.ones((SIZE, SIZE))], -1
    )
    ray = ray @ clip.rotation[frame]
    eye = -clip.translation[frame] @ clip.rotation[frame]
    at = eye - ray * (eye[2] / ray[..., 2:])
    grey = 128 + 90 * np.sin(14 * at[..., 0] + 1) * np.cos(11 * at[..., 1])
    return np.repeat(grey.round().astype(np.uint8)[..., None], 3, 2)


def test_still_pictures_do_not_flicker(clip: PreparedClip, plate: Skin) -> None:
    pictures = [seen(clip, 0)] * FRAMES
    assert figures(clip, plate, pictures, pictures) == {"source_flicker": 0}


def test_brightness_to_and_fro_is_its_second_difference(clip: PreparedClip, plate: Skin) -> None:
    # Up by a and down by a: |a + 2 a + a| = 4 a.
    renders = [flat(100 + 3 * (-1) ** k) for k in range(FRAMES)]
    sources = [flat(50 + (-1) ** k) for k in range(FRAMES)]
    found = figures(clip, plate, renders, sources)
    assert found == pytest.approx({"source_flicker": 4, "flicker": 3})


def test_even_change_is_no_flicker(clip: PreparedClip, plate: Skin) -> None:
    pictures = [flat(100 + 5 * k) for k in range(FRAMES)]
    assert figures(clip, plate, pictures, pictures)["source_flicker"] == pytest.approx(0, abs=1e-9)


def test_a_head_that_moves_is_held_still(clip: PreparedClip, plate: Skin) -> None:
    random = np.random.default_rng(0)
    moving = replace(
        clip,
        rotation=rotation_from_vector(random.normal(0, 0.1, (FRAMES, 3))),
        translation=clip.translation + random.normal(0, 0.05, (FRAMES, 3)),
        centre=clip.centre + random.normal(0, 2, (FRAMES, 2)),
    )
    pictures = [seen(moving, k) for k in range(FRAMES)]
    held = figures(moving, plate, pictures, pictures)["source_flicker"]
    loose = figures(clip, plate, pictures, pictures)["source_flicker"]
    assert held < 1.2  # rounding to whole grey levels makes .7
    assert loose > 20


def test_a_cut_a_gap_and_a_missed_face_are_no_flicker(clip: PreparedClip, plate: Skin) -> None:
    cut = replace(clip, segment=np.arange(FRAMES) // 4)
    pictures = [flat(40 if k < 4 else 200) for k in range(FRAMES)]
    assert figures(cut, plate, pictures, pictures) == {"source_flicker": 0}

    missed = replace(clip, valid=np.arange(FRAMES) != 4)
    pictures = [flat(200 if k == 4 else 40) for k in range(FRAMES)]
    assert figures(missed, plate, pictures, pictures) == {"source_flicker": 0}

    flicker = Flicker(clip, plate)
    for k in (0, 1, 3, 4, 5):
        flicker.add(k, flat(40 if k < 2 else 200), flat(40 if k < 2 else 200))
    assert flicker.figures() == {"source_flicker": 0}
    assert figures(clip, plate, pictures, pictures)["source_flicker"] > 100


def test_what_is_out_of_sight_says_nothing(clip: PreparedClip, plate: Skin) -> None:
    renders = [flat(100 + 3 * (-1) ** k) for k in range(FRAMES)]
    turned = replace(clip, rotation=np.tile(np.diag([-1.0, 1.0, -1.0]), (FRAMES, 1, 1)))
    assert figures(turned, plate, renders, renders) == {}
    outside = replace(clip, centre=clip.centre + 4 * SIZE)
    assert figures(outside, plate, renders, renders) == {}


def test_points_lie_round_the_brows_and_not_on_the_eyes(clip: PreparedClip) -> None:
    random = np.random.default_rng(0)
    shape = np.concatenate([random.uniform(-0.7, 0.7, (478, 2)), np.zeros((478, 1))], 1)
    top = [(x, -0.4) for x in np.linspace(-0.5, 0.5, 9)]
    below = [(0.55, -0.2), (0.45, 0.0), (0.0, 0.2), (-0.45, 0.0), (-0.55, -0.2)]
    shape[list(BROWS_AND_BRIDGE), :2] = [*top, *below]
    turns = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    for lids, eye in ((LEFT_LIDS, -0.25), (RIGHT_LIDS, 0.25)):
        shape[list(lids), :2] = np.stack([eye + 0.1 * np.cos(turns), 0.1 * np.sin(turns)], 1)
    # The eye corners are points of both.
    shape[[33, 263], :2] = [(-0.35, 0.0), (0.35, 0.0)]
    skin = brow_skin(replace(clip, shape=shape))
    assert len(skin.points) > 200
    x, y = skin.points[:, 0], skin.points[:, 1]
    assert y.min() == pytest.approx(-0.4, abs=0.02)
    assert 0.15 < y.max() < 0.22
    for eye in (-0.25, 0.25):
        assert np.hypot(x - eye, y).min() > 0.1
    np.testing.assert_allclose(np.abs(skin.normals[:, 2]), 1)
