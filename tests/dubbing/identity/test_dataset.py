"""From a prepared clip to what is learned: measures of the face, and which frames count."""

from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from dfrf.cameras import project
from dfrf.data.dataset import EYES, HEAD, MIRRORED_EXPRESSION, MOUTH, RIM
from dfrf.field.mouth_pixels import LOWER_RIM, UPPER_RIM
from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.errors import ExplainedError, TrainingError
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.face.mouth.lip_measures import LIP_DISTANCES
from dubbing.face.mouth.mouth_shape import INNER_LIP, LIPS, OUTER_LIP
from dubbing.identity.clip_frames import ClipFrames
from dubbing.identity.dataset import (
    BROWS,
    EYES_POINTS,
    GAZE,
    LIDS,
    MOST_EXPRESSION,
    eye_boxes,
    lip_points,
    load_identity,
    mean_face,
    mouth_boxes,
    region_map,
    upper_face_expression,
)
from dubbing.identity.image_store import ImageStore
from dubbing.media import VideoWriter
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from tests.fakes import SIZE, write_prepared

FRAMES, UNIT = 12, 100.0


def face() -> np.ndarray:
    """(478, 2): eyes 100 px apart, lids 10 px open, brows 20 px above, gaze straight."""
    points = np.zeros((478, 2))
    for side, (inner, outer, upper, lower, brow, iris) in zip((-1, 1), EYES_POINTS, strict=True):
        x = 250 + 35 * side
        points[outer] = (250 + 50 * side, 200)
        points[inner] = (250 + 20 * side, 200)
        points[upper], points[lower] = (x, 195), (x, 205)
        points[brow], points[iris] = (x, 180), (x, 200)
    return points


@pytest.fixture
def prepared(tmp_path: Path) -> PreparedClip:
    path = tmp_path / "clip.mkv"
    with VideoWriter(path, 48, 40, Fraction(25), "ffv1") as writer:
        for _ in range(FRAMES):
            writer.write(np.full((40, 48, 3), 90, np.uint8))
    (tmp_path / "prepared").mkdir()
    return write_prepared(path, tmp_path / "prepared")


@pytest.fixture
def clip(prepared: PreparedClip) -> PreparedClip:
    return replace(prepared, landmarks=np.tile(face(), (FRAMES, 1, 1)).astype(np.float32))


def test_lids_brows_and_gaze_are_measured_from_rest_in_eye_distances(clip: PreparedClip) -> None:
    marks = clip.landmarks
    assert np.linalg.norm(marks[0, RIGHT_EYE_OUTER] - marks[0, LEFT_EYE_OUTER]) == UNIT
    for _, _, upper, lower, brow, iris in EYES_POINTS[1:]:
        marks[1, upper, 1] += 4  # lids 10 px less open
        marks[1, lower, 1] -= 6
        marks[2, brow, 1] -= 3
        marks[3, iris] += (2, 0)
        marks[4, iris] += (0, 1)
    expected = np.zeros((FRAMES, 6))
    expected[1, 1], expected[2, 3], expected[3, 4], expected[4, 5] = -10, 3, 1, 0.5
    found = upper_face_expression(clip)
    scale = np.array([LIDS, LIDS, BROWS, BROWS, GAZE, GAZE])
    np.testing.assert_allclose(found, expected / UNIT / scale, atol=1e-3)


def test_a_mirrored_face_has_the_mirrored_measures(clip: PreparedClip) -> None:
    left, right = map(list, EYES_POINTS)
    noise = np.random.default_rng(0).normal(0, 2, (FRAMES, 2, len(left), 2))
    clip.landmarks[:, left] += noise[:, 0]
    clip.landmarks[:, right] += noise[:, 1]
    mirrored = clip.landmarks.copy()
    mirrored[:, left], mirrored[:, right] = clip.landmarks[:, right], clip.landmarks[:, left]
    mirrored[..., 0] = clip.size - 1 - mirrored[..., 0]
    order, signs = map(list, zip(*MIRRORED_EXPRESSION, strict=True))
    found = upper_face_expression(replace(clip, landmarks=mirrored))
    np.testing.assert_allclose(found, upper_face_expression(clip)[:, order] * signs, atol=1e-3)


def test_a_tilted_or_nearer_face_has_the_same_measures(clip: PreparedClip) -> None:
    clip.landmarks[1, EYES_POINTS[0][4], 1] -= 6
    straight = upper_face_expression(clip)
    turn = 1.5 * np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    tilted = replace(clip, landmarks=(clip.landmarks @ turn.T).astype(np.float32))
    np.testing.assert_allclose(upper_face_expression(tilted), straight, atol=1e-3)


def test_a_head_that_turns_keeps_its_measures(clip: PreparedClip) -> None:
    """Eyes of a face in profile are narrow: what is measured in the picture has any value."""
    shape = np.zeros((478, 3))
    shape[:, :2] = (face() - (250, 200)) / UNIT * 0.9
    shape[:, 2] = -np.cos(2 * shape[:, 0])  # a round face
    turns = np.linspace(-70, 70, FRAMES)[:, None]
    rotation = Rotation.from_euler("y", turns, degrees=True).as_matrix()
    translation = np.tile([0.0, 0.0, 7.0], (FRAMES, 1))
    seen = shape @ rotation.transpose(0, 2, 1) + translation[:, None]
    landmarks = clip.centre[:, None] + clip.focal * seen[..., :2] / seen[..., 2:]
    turned = replace(
        clip, shape=shape, rotation=rotation, translation=translation, landmarks=landmarks
    )
    assert np.abs(upper_face_expression(turned)).max() < 0.01


def test_lips_that_touch_are_seen_to_touch_however_the_head_is_turned(clip: PreparedClip) -> None:
    """The lips of the mean face are open, so shut ones seem open when seen from the front."""
    shape = np.zeros((478, 3))
    shape[:, :2] = (face() - (250, 200)) / UNIT * 0.9
    upper, lower = LIP_DISTANCES[0]
    shape[[upper, lower]] = (0, 0.9, -1.0), (0, 1.0, -0.9)
    turns = np.stack([np.linspace(-60, 60, FRAMES), np.full(FRAMES, 15.0)], 1)
    rotation = Rotation.from_euler("yx", turns, degrees=True).as_matrix()
    translation = np.tile([0.0, 0.0, 7.0], (FRAMES, 1))
    shut = np.tile(shape, (FRAMES, 1, 1))
    shut[::2, lower] = shut[::2, upper] + (0, 0.01, 0)  # the others stay open
    seen = shut @ rotation.transpose(0, 2, 1) + translation[:, None]
    landmarks = clip.centre[:, None] + clip.focal * seen[..., :2] / seen[..., 2:]
    turned = replace(
        clip, shape=shape, rotation=rotation, translation=translation, landmarks=landmarks
    )
    turned.save()
    speech = SpeechFrames(np.zeros((FRAMES, 16, 2), np.float32), np.zeros((FRAMES, 8), np.float32))
    person = load_identity("someone", [ClipFrames(turned, speech, np.arange(FRAMES))])
    assert person.touching.tolist() == [1.0, 0.0] * (FRAMES // 2)


def test_what_is_said_is_read_off_lips_as_speech_had_them(clip: PreparedClip) -> None:
    """Landmarks, by which mouths are compared, stay."""
    opened = np.arange(FRAMES) % 2 == 0
    shift = np.zeros((FRAMES, 40, 2))
    shift[np.ix_(opened, [LIPS.index(lower) for _, lower in LIP_DISTANCES[:3]], [1])] = UNIT
    speech = SpeechFrames(np.zeros((FRAMES, 16, 2), np.float32), np.zeros((FRAMES, 8), np.float32))
    told, said = (
        load_identity("someone", [ClipFrames(one, speech, np.arange(FRAMES))])
        for one in (clip, replace(clip, lip_shift=shift))
    )
    assert not torch.equal(told.lips, said.lips)
    assert (said.lips[opened, 0] > said.lips[~opened, 0].max()).all()
    assert not said.touching[opened].any()
    assert torch.equal(told.lip_points, said.lip_points)


def test_no_measure_is_wild(clip: PreparedClip) -> None:
    clip.landmarks[3, EYES_POINTS[0][5]] += 40
    assert np.abs(upper_face_expression(clip)).max() == MOST_EXPRESSION


def test_frames_without_a_face_are_at_rest(clip: PreparedClip) -> None:
    clip.landmarks[5] = np.nan
    clip.valid[5] = False
    found = upper_face_expression(clip)
    assert not np.isnan(found).any()
    assert (found[5] == 0).all()


def test_sound_and_lips_of_every_frame_stand_beside_some_of_the_pictures(
    clip: PreparedClip,
) -> None:
    clip.save()
    windows = np.arange(FRAMES * 16 * 2, dtype=np.float32).reshape(FRAMES, 16, 2)
    lips = np.arange(FRAMES * 8, dtype=np.float32).reshape(FRAMES, 8)
    speech = SpeechFrames(windows, lips)
    person = load_identity("someone", [ClipFrames(clip, speech, np.arange(1, 10))], every=4)
    assert person.frames == 3
    assert person.number.tolist() == [0, 4, 8]
    assert torch.equal(person.windows, torch.from_numpy(windows[1:10]))
    assert torch.equal(person.predicted_lips, torch.from_numpy(lips[1:10]))
    assert person.lips.shape == (9, 7)
    assert person.touching.shape == (9,)
    assert person.expression.shape == (3, 6)


def test_pictures_in_files_are_those_in_memory(clip: PreparedClip, tmp_path: Path) -> None:
    clip.valid[2] = False
    clip.save()
    speech = SpeechFrames(
        np.zeros((FRAMES, 16, 2), np.float32), np.zeros((FRAMES, NUMBERS), np.float32)
    )
    folder = tmp_path / "pictures"
    held = load_identity("someone", [ClipFrames(clip, speech, np.arange(1, 10))])
    for _ in range(2):  # the second time over what the first one left
        mapped = load_identity(
            "someone", [ClipFrames(clip, speech, np.arange(1, 10))], folder=folder
        )
        for field in fields(held):
            here, there = getattr(held, field.name), getattr(mapped, field.name)
            assert torch.equal(here, there) if isinstance(here, torch.Tensor) else here == there
    assert {path.name: path.stat().st_size for path in folder.iterdir()} == {
        name: getattr(held, name).numel() for name in ("images", "backgrounds", "mattes", "regions")
    }
    assert held.mattes.float().std() > 0
    mapped.mattes[:] = 0  # what is mapped cannot spoil the files
    again = load_identity("someone", [ClipFrames(clip, speech, np.arange(1, 10))])
    assert (folder / "mattes").read_bytes() == again.mattes.numpy().tobytes()


def test_several_clips_are_one_person_seen_by_one_camera(
    clip: PreparedClip, tmp_path: Path
) -> None:
    clip.save()
    (tmp_path / "other").mkdir()
    other = write_prepared(clip.clip, tmp_path / "other")
    other = replace(other, focal=clip.focal / 1.5, landmarks=clip.landmarks)
    other.save()
    windows = np.arange(FRAMES * 16 * 2, dtype=np.float32).reshape(FRAMES, 16, 2)
    speech = SpeechFrames(windows, np.zeros((FRAMES, NUMBERS), np.float32))
    alone = load_identity("someone", [ClipFrames(other, speech, np.arange(4, 8))])
    person = load_identity(
        "someone",
        [
            ClipFrames(clip, speech, np.arange(1, 6)),
            ClipFrames(other, speech, np.arange(0)),
            ClipFrames(other, speech, np.arange(4, 8)),
        ],
    )
    assert person.focal == clip.focal
    assert person.number.tolist() == list(range(9))
    assert torch.equal(person.windows, torch.from_numpy(windows[[*range(1, 6), *range(4, 8)]]))
    first, second = person.segment[:5], person.segment[5:]
    assert not set(first.tolist()) & set(second.tolist())
    # A larger picture of the same: the matte covers 1.5 x 1.5 as much.
    share = person.mattes[5:].float().sum() / alone.mattes.float().sum()
    assert 1.9 < share < 2.5


@pytest.mark.parametrize("side", [SIZE // 2, SIZE * 2])
def test_clips_of_other_sizes_are_learned_together(
    clip: PreparedClip, tmp_path: Path, side: int
) -> None:
    clip.save()
    (tmp_path / "other").mkdir()
    other = write_prepared(clip.clip, tmp_path / "other", size=side)
    windows = np.zeros((FRAMES, 16, 2), np.float32)
    speech = SpeechFrames(windows, np.zeros((FRAMES, NUMBERS), np.float32))
    films = [ClipFrames(one, speech, np.arange(2)) for one in (clip, other)]
    person = load_identity("someone", films, folder=tmp_path / "pictures")
    assert person.images.shape == (4, SIZE, SIZE, 3)
    np.testing.assert_allclose((person.centres[2] + 0.5) / SIZE, (other.centre[0] + 0.5) / side)
    share = person.mattes.flatten(1).float().mean(1)
    assert share[2:] == pytest.approx(share[:2], rel=0.1)
    landmarks = films[1].landmarks(clip)
    np.testing.assert_allclose((landmarks + 0.5) / SIZE, (other.landmarks[:2] + 0.5) / side)


def test_a_folder_that_cannot_be_written_is_said(clip: PreparedClip, tmp_path: Path) -> None:
    clip.save()
    speech = SpeechFrames(
        np.zeros((FRAMES, 16, 2), np.float32), np.zeros((FRAMES, NUMBERS), np.float32)
    )
    (tmp_path / "file").write_text("")
    with pytest.raises(ExplainedError, match="file"):
        load_identity(
            "someone",
            [ClipFrames(clip, speech, np.arange(1, 10))],
            folder=tmp_path / "file" / "pictures",
        )
    full = ImageStore({"images": (1, 99, 99)}, tmp_path / "full")
    (tmp_path / "full" / "images").symlink_to("/dev/full")
    with pytest.raises(ExplainedError, match="No space left on device"):
        full.add(images=np.zeros((99, 99), np.uint8))


def test_rays_are_drawn_round_mouth_and_eyes_and_at_the_rim() -> None:
    points = face()
    points[[61, 291]] = (220, 280), (280, 280)
    points[[0, 17]] = (250, 270), (250, 290)
    for k in range(478):
        if not points[k].any():
            points[k] = (250, 280)
    matte = np.zeros((400, 400), np.uint8)
    matte[100:350, 150:350] = 255
    (mouth,), (eyes,) = mouth_boxes(points[None], 400), eye_boxes(points[None], 400)
    region = region_map(matte, mouth, eyes)
    assert region[280, 250] == MOUTH
    assert region[200, 215] == region[200, 285] == region[182, 215] == EYES
    assert region[200, 250] == region[230, 250] == HEAD
    assert region[200, 150] == region[346, 250] == RIM
    assert region[50, 50] == 0


def test_a_part_without_a_face_is_refused(prepared: PreparedClip) -> None:
    speech = SpeechFrames(np.zeros((FRAMES, 16, 2)), np.zeros((FRAMES, NUMBERS)))
    with pytest.raises(TrainingError, match="no frame with a face"):
        load_identity("someone", [ClipFrames(prepared, speech, np.arange(0))])


def test_lips_lie_beside_those_of_the_mean_face_by_what_is_seen(clip: PreparedClip) -> None:
    lips = [*OUTER_LIP, *INNER_LIP]
    shape = np.random.default_rng(0).normal(size=(478, 3)) * 0.05 + [0, 0.4, -0.8]
    clip = replace(clip, shape=shape, landmarks=clip.landmarks.copy())
    frames = np.array([2, 5])
    c2w = torch.from_numpy(clip.c2w()[frames]).float()
    still = project(
        mean_face(clip, lips), c2w, float(clip.focal), torch.from_numpy(clip.centre[frames])
    )
    clip.landmarks[frames[:, None], lips] = still.numpy()
    torch.testing.assert_close(lip_points(clip, frames), torch.zeros(2, 40, 2), atol=1e-4, rtol=0)
    clip.landmarks[frames[:, None], lips] += [0, 3]
    moved = lip_points(clip, frames)
    assert moved[..., 0].abs().max() < 1e-4
    apart = np.linalg.norm(c2w[0, :, 3].numpy() - [0, -0.4, 0.8])
    assert moved[0, :, 1].mean().item() == pytest.approx(3 * apart / float(clip.focal), rel=0.05)


def test_the_gap_is_measured_between_the_inner_lips() -> None:
    points = [*OUTER_LIP, *INNER_LIP]
    assert [points[k] for k in UPPER_RIM] == [82, 13, 312]
    assert [points[k] for k in LOWER_RIM] == [87, 14, 317]
