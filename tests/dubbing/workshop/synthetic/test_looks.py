"""Beard, moustache, glasses, loose hair, light from the side, and heads that are turned far."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.workshop.synthetic.anatomy.eyes import REACH_DEGREES, within_reach
from dubbing.workshop.synthetic.anatomy.face import BLENDED, FACES, Face, random_face
from dubbing.workshop.synthetic.anatomy.hair import grow
from dubbing.workshop.synthetic.anatomy.head import GLASSES, HeadModel, Trunk
from dubbing.workshop.synthetic.anatomy.head_shape import MOUTH_HALF_WIDTH, MOUTH_Y, head_distance
from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.motion import PIVOT
from dubbing.workshop.synthetic.rendering.camera import FLIP, UNIT, Pose
from dubbing.workshop.synthetic.rendering.render import REST_SHIFT, RenderedFrame, Renderer, State
from dubbing.workshop.synthetic.rendering.shading import Lighting

pytestmark = pytest.mark.medium

SHUT, OPEN = MouthShape(), MouthShape(jaw=0.8, part=0.6)
STRAIGHT = Trunk(np.eye(3), np.zeros(3))
SIZE = 128
PIXELS_PER_CM = 980 * SIZE / 512 / 78


def turned(yaw: float) -> Pose:
    """The head turned about the neck, degrees."""
    turn = Rotation.from_euler("Y", yaw, degrees=True).as_matrix()
    return Pose(FLIP @ turn @ FLIP, FLIP @ (REST_SHIFT + PIVOT - turn @ PIVOT) / UNIT)


def shot(face: Face, yaw: float = 0.0, light: Lighting = "soft") -> RenderedFrame:
    return Renderer(face, SIZE, light=light).render(State(turned(yaw), SHUT))


def lowest(matte: np.ndarray) -> int:
    """The last row of a head matte."""
    return int(np.flatnonzero((matte > 127).any(axis=1))[-1])


def test_a_beard_follows_the_jaw_and_a_moustache_stays() -> None:
    model = HeadModel(FACES["fedor"])
    locks = slice(-len(model.beard.roots), None)
    shut = model.vertices(SHUT, STRAIGHT)[locks]
    moved = model.vertices(OPEN, STRAIGHT)[locks] - shut
    front = (shut[:, 2] > 7) & (np.abs(shut[:, 0]) < 2)
    chin, above = front & (shut[:, 1] < -7), front & (shut[:, 1] > MOUTH_Y + 0.6)
    assert chin.sum() > 1000
    assert above.sum() > 500
    assert moved[chin, 1].mean() < -1.0
    assert moved[chin, 1].max() < -0.5
    assert np.abs(moved[above]).max() < 0.5


def test_a_beard_leaves_the_lips_free_and_their_opening_as_it_was() -> None:
    face = FACES["fedor"]
    bearded, shaved = HeadModel(face), HeadModel(replace(face, beard=0.0, moustache=0.0))
    assert len(shaved.beard.roots) == 0
    for shape in (SHUT, OPEN, MouthShape(protrude=1.0, wide=-1.0, part=0.4)):
        with_beard, without = (m.vertices(shape, STRAIGHT) for m in (bearded, shaved))
        assert bearded.opening(with_beard) == shaved.opening(without)
    line = bearded.rest[bearded.line_indices("lower")[bearded.mouth_columns]]
    locks = bearded.beard.hair.vertices
    near = [np.linalg.norm(locks - point, axis=1).min() for point in line[2:-2:4]]
    assert min(near) > 0.15


def test_a_beard_hangs_below_the_chin_in_the_matte_and_is_dark() -> None:
    face = FACES["fedor"]
    renderer, straight = Renderer(face, SIZE), turned(0)
    bearded, fallen = (renderer.render(State(straight, mouth)) for mouth in (SHUT, OPEN))
    shaved = shot(replace(face, beard=0.0, moustache=0.0))
    assert lowest(bearded.head) - lowest(shaved.head) >= 0.7 * PIXELS_PER_CM
    column = SIZE // 2
    chin = np.s_[lowest(shaved.head) - 6 : lowest(shaved.head) - 2, column - 4 : column + 4]
    assert bearded.image[chin].mean() < 0.7 * shaved.image[chin].mean()
    assert lowest(fallen.head) - lowest(bearded.head) >= 0.8 * PIXELS_PER_CM


def test_glasses_are_rigid_and_belong_to_the_head() -> None:
    face = FACES["gita"]
    model = HeadModel(face)
    frame = model.part == GLASSES
    assert frame.any()
    mouth = model.vertices(OPEN, Trunk(turned(80).turn.T, np.ones(3)))
    np.testing.assert_array_equal(mouth[frame], model.rest[frame])
    assert not frame[model.moving].any()
    assert head_distance(model.rest[frame], face).min() > 0.0  # on the face, not in it
    with_glasses, without = shot(face, yaw=60), shot(replace(face, glasses=False), yaw=60)
    beside = (with_glasses.head > 200) & (without.head == 0)  # the far rim, before the wall
    assert beside.sum() > 5
    assert with_glasses.image[beside].mean() < 80


def test_loose_hair_falls_beside_the_mouth_and_onto_the_chest() -> None:
    face = FACES["hana"]
    hair = grow(face).vertices
    beside = (np.abs(hair[:, 1] - MOUTH_Y) < 0.7) & (hair[:, 2] > 7.5)
    assert beside.sum() > 20
    assert hair[beside, 0].min() > MOUTH_HALF_WIDTH - 0.3  # over one cheek only, not over the lips
    assert hair[beside, 0].max() < 5.5
    assert head_distance(hair[beside], face).min() > 0.0
    assert hair[:, 1].min() < -17
    assert lowest(shot(face).head) > lowest(shot(replace(face, hair_style="bald")).head) + 20


def test_light_from_the_side_leaves_half_of_the_face_dark() -> None:
    def halves(light: Lighting) -> float:
        image = shot(FACES["alba"], light=light).image.astype(float)
        middle, rows, columns = SIZE // 2, slice(64, 74), np.arange(8, 15)
        left, right = image[rows, middle - columns], image[rows, middle + columns]
        return float(left.mean() / right.mean())

    assert halves("side") > 1.35 * halves("soft")


def test_eyes_turn_no_further_than_eyes_can() -> None:
    ahead = np.array([[0.3, 0.2, 0.8], [-0.1, 0.0, 0.9]])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    np.testing.assert_array_equal(within_reach(ahead), ahead)
    far = np.array([[0.98, 0.1, 0.17], [0.6, -0.6, -0.53]])
    far /= np.linalg.norm(far, axis=1, keepdims=True)
    reached = within_reach(far)
    np.testing.assert_allclose(reached[:, 2], np.cos(np.radians(REACH_DEGREES)))
    np.testing.assert_allclose(np.linalg.norm(reached, axis=1), 1.0)
    np.testing.assert_allclose(np.cross(reached[:, :2], far[:, :2]), 0.0, atol=1e-9)


@pytest.mark.parametrize("yaw", [-80, 60, 80])
def test_the_neck_keeps_its_thickness_when_the_head_turns(yaw: float) -> None:
    model = HeadModel(FACES["alba"])
    patch = model.patches["neck"]

    def thickness(vertices: np.ndarray) -> np.ndarray:
        rows = vertices[patch.first : patch.last].reshape(patch.rows, patch.columns, 3)
        return np.linalg.norm(rows - rows.mean(axis=1, keepdims=True), axis=2).mean(axis=1)

    to_head = turned(yaw).turn.T
    trunk = Trunk(to_head, to_head @ (REST_SHIFT - turned(yaw).shift))
    straight, bent = (thickness(model.vertices(SHUT, t)) for t in (STRAIGHT, trunk))
    np.testing.assert_allclose(bent, straight, rtol=0.05)


def test_random_faces_are_drawn_from_the_first_five() -> None:
    assert sorted(FACES)[:5] == list(BLENDED)
    faces = [random_face(seed) for seed in range(40)]
    assert {face.hair_style for face in faces} <= {FACES[name].hair_style for name in BLENDED}
    assert not any(face.beard or face.moustache or face.glasses for face in faces)
    assert faces[4].hair_style == "short"
    np.testing.assert_allclose(faces[4].skin, (0.581878, 0.347155, 0.258469), atol=1e-6)
