"""The clip and its truth agree with each other and with what a face tracker sees."""

import hashlib
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from dubbing.errors import ExplainedError
from dubbing.face.finding.landmarks import FaceMesh
from dubbing.media import probe, read_audio, read_frames
from dubbing.workshop.synthetic.anatomy.face import FACES
from dubbing.workshop.synthetic.anatomy.skin_grid import skin_grid
from dubbing.workshop.synthetic.speaker import SpeakerTruth, fit_phones, make_speaker, place_sound
from dubbing.workshop.synthetic.visemes import Phone

pytestmark = pytest.mark.medium


Clip = tuple[Path, SpeakerTruth]
OUTER, INNER = (33, 263), (133, 362)  # FaceMesh: eye corners, in the picture left and right
LIPS, LIDS = (13, 14), (159, 145)


@pytest.fixture(scope="module")
def landmarks(clip: Clip) -> np.ndarray:
    """FaceMesh (T, 478, 2) in px; a frame without a face is an error."""
    folder, _ = clip
    found, mesh = [], FaceMesh(tracking=True)
    for index, frame in enumerate(read_frames(folder / "clip.mp4")):
        faces = mesh(frame)
        assert faces, f"no face in frame {index}"
        found.append(faces[0][:, :2])
    return np.array(found)


def project(truth: SpeakerTruth, points: np.ndarray) -> np.ndarray:
    """Pixels (T, N, 2) of head points (N, 3) by the truth as it is documented."""
    camera = np.einsum("tij,nj->tni", truth.rotation, points) + truth.translation[:, None]
    return truth.focal * camera[..., :2] / camera[..., 2:] + truth.centre


def surface_point(x: float, y: float) -> np.ndarray:
    """The skin at (x, y) units of the head's frame (OpenCV axes), on the side of the face."""
    skin = skin_grid(FACES["alba"]).points.reshape(-1, 3) * np.array([0.1, -0.1, -0.1])
    skin = skin[skin[:, 2] < -0.3]
    return skin[np.argmin((skin[:, 0] - x) ** 2 + (skin[:, 1] - y) ** 2)]


def test_tracker_finds_the_face_in_every_frame(clip: Clip, landmarks: np.ndarray) -> None:
    assert landmarks.shape == (clip[1].frames, 478, 2)


def test_pose_puts_eye_corners_where_the_picture_shows_them(
    clip: Clip, landmarks: np.ndarray
) -> None:
    points = np.stack([surface_point(x, -0.3) for x in (-0.45, 0.45, -0.18, 0.18)])
    error = landmarks[:, OUTER + INNER] - project(clip[1], points)
    between_eyes = np.linalg.norm(landmarks[:, 33] - landmarks[:, 263], axis=1).mean()
    assert np.abs(error.mean(axis=0)).max() < 0.035 * between_eyes  # landmarks are biased
    assert error.std(axis=0).max() < 0.02 * between_eyes  # but the head's motion is followed


def test_motion_is_seen(clip: Clip) -> None:
    nose = project(clip[1], np.array([[0.0, 0.05, -1.1]]))
    assert nose.std(axis=0).max() > 1.0
    yaw = np.degrees(np.arctan2(clip[1].rotation[:, 0, 2], clip[1].rotation[:, 2, 2]))
    assert np.ptp(yaw) > 3.0


def test_lip_opening_is_what_a_tracker_measures(clip: Clip, landmarks: np.ndarray) -> None:
    upper, lower = (landmarks[:, k] for k in LIPS)
    gap = np.linalg.norm(upper - lower, axis=1)
    assert np.corrcoef(gap, clip[1].opening)[0, 1] > 0.9


def test_mouth_closes_on_p_b_m_and_opens_on_open_vowels(clip: Clip) -> None:
    truth = clip[1]
    times = (np.arange(truth.frames) + 0.5) / float(truth.rate)

    def near(phone: Phone) -> np.ndarray:
        return truth.opening[(times > phone.start - 0.06) & (times < phone.end + 0.02)]

    closures = [p for p in truth.phones if p.symbol in ("p", "b", "m")]
    vowels = [p for p in truth.phones if p.symbol[:1] in ("ɑ", "æ", "a", "ʌ")]
    assert len(closures) >= 6
    assert len(vowels) >= 3
    assert max(near(p).min() for p in closures) < 0.02
    assert min(near(p).max() for p in vowels if p.end - p.start > 0.06) > 0.07


def test_blinks_shut_the_eyes(clip: Clip, landmarks: np.ndarray) -> None:
    upper, lower = (landmarks[:, k] for k in LIDS)
    lids = np.linalg.norm(upper - lower, axis=1)
    blink = clip[1].blink
    assert blink.max() > 0.9
    assert lids[blink > 0.8].mean() < 0.5 * lids[blink < 0.1].mean()


def test_matte_is_the_silhouette(clip: Clip) -> None:
    """Where the matte is 0 the picture is the background; where it is 255 it is not."""
    folder, truth = clip
    for index, frame in enumerate(read_frames(folder / "clip.mp4")):
        if index % 25 != 12:
            continue
        change = np.abs(frame.astype(float) - truth.background).max(axis=2)
        head, person = truth.head[index], truth.person[index]
        room = cv2.dilate(person, np.ones((9, 9))) == 0
        assert change[room].mean() < 3.0  # what the video codec leaves
        assert np.mean(change[head == 255] > 12) > 0.93
        assert np.all(person >= head)
        assert 0.1 < np.mean(head > 127) < 0.4


def test_eye_corners_are_09_units_apart() -> None:
    left, right = surface_point(-0.45, -0.3), surface_point(0.45, -0.3)
    assert right[0] - left[0] == pytest.approx(0.9, abs=0.03)


def test_clip_has_picture_and_sound_of_one_length(clip: Clip) -> None:
    folder, truth = clip
    info = probe(folder / "clip.mp4")
    assert (info.width, info.height, info.rate) == (256, 256, Fraction(25))
    assert info.frames == truth.frames == 75
    assert info.audio_duration == pytest.approx(3.0, abs=0.03)


def test_truth_survives_the_disk(clip: Clip) -> None:
    folder, truth = clip
    again = SpeakerTruth.load(folder / "truth.npz")
    assert (again.rate, again.phones, again.offset_frames) == (truth.rate, truth.phones, 0)
    np.testing.assert_array_equal(again.head, truth.head)
    np.testing.assert_array_equal(again.rotation, truth.rotation)


def test_same_call_same_files_and_an_offset_moves_only_the_sound(tmp_path: Path) -> None:
    def make(name: str, offset: int) -> Path:
        make_speaker(
            tmp_path / name, text="Mama.", seconds=0.6, size=64, seed=5, offset_frames=offset
        )
        return tmp_path / name

    def digest(path: Path) -> str:
        return hashlib.sha256(path.read_bytes()).hexdigest()

    first, second, early = make("a", 0), make("b", 0), make("c", 3)
    for name in ("clip.mp4", "truth.npz", "speech.wav"):
        assert digest(first / name) == digest(second / name)
    pictures = [list(read_frames(folder / "clip.mp4")) for folder in (first, early)]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    plain, moved = (read_audio(folder / "speech.wav") for folder in (first, early))
    shift = 3 * 16000 // 25
    np.testing.assert_allclose(plain[shift:4800], moved[: 4800 - shift], atol=0.02)


def test_sound_is_placed_early_and_late() -> None:
    samples = np.arange(1, 11, dtype=np.float32)
    np.testing.assert_array_equal(place_sound(samples, 10, 0.5, 0.2), [3, 4, 5, 6, 7])
    np.testing.assert_array_equal(place_sound(samples, 10, 0.5, -0.2), [0, 0, 1, 2, 3])
    np.testing.assert_array_equal(place_sound(samples, 10, 1.2, 0.0)[-3:], [10, 0, 0])


def test_phones_are_cut_or_followed_by_silence() -> None:
    phones = [Phone("a", 0.0, 0.4), Phone("b", 0.4, 0.8)]
    assert fit_phones(phones, 0.5)[-1] == Phone("b", 0.4, 0.5)
    assert fit_phones(phones, 1.0)[-1] == Phone("", 0.8, 1.0)


def test_faces_look_different(tmp_path: Path) -> None:
    pictures = {}
    for face in ("alba", "chidi", "random:4"):
        make_speaker(tmp_path / face, text="A.", seconds=0.04, size=64, face=face)
        pictures[face] = next(iter(read_frames(tmp_path / face / "clip.mp4"))).astype(float)
    assert np.abs(pictures["alba"] - pictures["chidi"]).mean() > 8
    assert np.abs(pictures["alba"] - pictures["random:4"]).mean() > 4


def test_mistakes_give_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(ExplainedError, match="no synthetic face is called 'zoe'"):
        make_speaker(tmp_path, text="A.", face="zoe")
    with pytest.raises(ExplainedError, match="an even size"):
        make_speaker(tmp_path, text="A.", size=101)
