"""What preparation says may go wrong, and in which frames."""

from fractions import Fraction
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from dubbing.preparation.tracking.warnings import face_warnings_of, warnings_of

if TYPE_CHECKING:
    from dubbing.media import MediaInfo
    from dubbing.preparation.alignment.camera import Poses

FRAMES = 10


def warnings_for(
    apart: dict[int, float],
    faces: int = 1,
    over: tuple[int, ...] = (),
    dissolved: tuple[int, ...] = (),
    hidden: tuple[int, ...] = (),
    lost: tuple[int, ...] = (),
    yaw: tuple[float, ...] = (0.0,) * FRAMES,
    cut: int = FRAMES,
    first: int = 0,
) -> list[str]:
    """Warnings of a calm clip at 5 fps whose modes differ by so many px in some frames."""
    info = SimpleNamespace(frames=FRAMES, rate=Fraction(5), variable_rate=False)
    info.width, info.height = 640, 512
    points = np.zeros((FRAMES, 478, 3))
    points[:, :, :2] = np.random.default_rng(0).uniform(0, 400, (478, 2))
    gaps = np.zeros(FRAMES)
    gaps[list(apart)] = list(apart.values())
    seen = {
        "most_faces": np.array(faces),
        "other": np.array([5.0, 448.0, 128.0]) if faces > 1 else np.full(3, np.nan),
        "box": np.tile([64.0, 192.0, 192.0, 320.0], (FRAMES, 1)),
        "segment": (np.arange(FRAMES) >= cut).astype(int),
        "distance": np.array([0.0, 0.3])[: 1 + (cut < FRAMES)],
        "repeated": np.zeros(FRAMES, bool),
        "shown": np.where(np.isin(np.arange(FRAMES), dissolved), 0.7, 1.0),
        "window": np.tile([0.0, 0.0, 512.0, 0.0], (FRAMES, 1)),
    }
    found = {"valid": ~np.isin(np.arange(FRAMES), lost), "apart": gaps, "points": points}
    found["covered"] = np.isin(np.arange(FRAMES), hidden)
    found["over"] = np.isin(np.arange(FRAMES), over)
    turns = Rotation.from_euler("y", np.negative(yaw)[:, None], degrees=True).as_matrix()
    poses = SimpleNamespace(rotation=turns, translation=np.tile([0.0, 0.0, 9.0], (FRAMES, 1)))
    clip = cast("MediaInfo", info)
    others = warnings_of(clip, first, 512, seen, found, cast("Poses", poses))
    return [*face_warnings_of(clip, first, seen), *others]


def test_a_calm_clip_has_no_warnings() -> None:
    assert warnings_for({3: 2.9}) == []


def test_of_a_part_times_and_frames_are_those_of_the_clip() -> None:
    asked: dict[str, Any] = {"faces": 2, "lost": (3,), "dissolved": (8,), "cut": 7}
    whole = warnings_for({}, **asked)
    part = warnings_for({}, **asked, first=50)
    moved = [
        ("at 1.0 s that", "at 11.0 s that"),
        ("at: 1.00", "at: 11.00"),
        ("at frames 7 (0.30)", "at frames 57 (0.30)"),
        ("first at 0.6 s", "first at 10.6 s"),
        ("first at 1.6 s", "first at 11.6 s"),
        ("at frames 7;", "at frames 57;"),
    ]
    told = "\n".join(whole)
    for before, after in moved:
        assert before in told
        told = told.replace(before, after)
    assert "\n".join(part) == told


def test_what_stays_over_the_new_mouth_and_what_fades_with_its_shot() -> None:
    over, dissolve = warnings_for({}, over=(4, 5, 6), dissolved=(8,))
    assert "over the lower face in 3 frames, the first at 0.8 s" in over
    assert "stays over the new mouth" in over
    assert "dissolve into one another in 1 frames, the first at 1.6 s" in dissolve


def test_hidden_frames_are_said_without_a_promise() -> None:
    no_face, covered, over = warnings_for({}, hidden=(1, 2), lost=(2, 7), over=(1, 6))
    assert no_face.startswith("no face in 2 of 10 frames, the first at 0.4 s")
    assert "covered, or lit as nowhere else, in 1 frames, the first at 0.2 s" in covered
    assert covered.endswith(
        "left as filmed, unless the learned head explains them, or tells what covers it"
    )
    assert "over the lower face in 1 frames, the first at 1.2 s" in over  # not the covered one


def test_a_turned_head_is_said_with_its_angles() -> None:
    assert warnings_for({}, yaw=(34.0,) * FRAMES) == []
    yaw = (0.0,) * 8 + (-40.0, -62.0)
    (turned,) = warnings_for({}, yaw=yaw)
    assert turned.startswith(
        "the head is turned 0 to 52 degrees left (62 left at most), more than 35 degrees in "
        "2 frames, the first at 1.6 s"
    )
    assert warnings_for({}, yaw=yaw, lost=(8, 9))[1:] == []


def test_of_several_faces_the_chosen_one_and_the_way_to_another_are_said() -> None:
    (said,) = warnings_for({}, faces=2)
    assert "up to 2 faces in a frame" in said
    assert "at 1.0 s that at x 0.20, y 0.50; for another set" in said
    assert said.endswith("face: {at: 1.00, x: 0.70, y: 0.25}")


def test_modes_that_disagree_a_little_are_unsure_and_no_hand_before_the_face() -> None:
    (unsure,) = warnings_for({3: 4.0, 7: 5.9})
    assert unsure.startswith("the landmarks are unsure in 2 frames, the first at 0.6 s")
    (covered,) = warnings_for({4: 6.5})
    assert covered.startswith("something may cover the face in 1 frames, the first at 0.8 s")
