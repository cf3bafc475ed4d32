"""Covers of a face are found where a head cannot explain the picture."""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest
import torch

from dfrf.method_interface import Method
from dubbing.heads import covers, mended_poses
from dubbing.heads.comparison import (
    Compared,
    H,
    W,
    compare,
    is_awry,
    to_face,
    usual_difference,
)
from dubbing.heads.cover_cut import (
    beside_told,
    followed,
    is_large,
    is_like_skin,
    mask_of,
    steady,
    unexplained,
    whole,
)
from dubbing.heads.covers import MOST_USUAL, lasting, runs_of, told_apart
from dubbing.media import VideoWriter
from dubbing.preparation.prepared import PreparedClip
from tests import fakes

FACE = np.zeros((H, W), bool)
FACE[10:70, 14:74] = True
LIPS = np.zeros((H, W), bool)
LIPS[44:56, 30:58] = True
NOSE = np.zeros((H, W), bool)
NOSE[18:38, 36:52] = True
SKIN, RED, DARK = (200, 150, 130), (170, 80, 80), (60, 62, 66)


def face(thing: tuple[slice, slice] | None = None, noise: int = 0) -> Compared:
    """A face that the head explains, but for a thing over it, and lips that say other words."""
    picture = np.zeros((H, W, 3), np.uint8)
    picture[FACE] = SKIN
    picture[LIPS] = RED
    expected = picture.copy()
    picture[48:52, 34:54] = (20, 10, 10)  # an open mouth
    if thing is not None:
        picture[thing] = DARK
    rng = np.random.default_rng(noise)
    picture = np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)
    apart = np.abs(np.log(picture + 12.0) - np.log(expected + 12.0)).max(-1) * FACE
    return Compared(picture, apart.astype(np.float32), FACE & ~LIPS, LIPS, FACE & ~LIPS, NOSE)


def film(folder: Path, frames: int) -> PreparedClip:
    with VideoWriter(folder / "clip.mkv", 48, 40, Fraction(25), "ffv1") as writer:
        for _ in range(frames):
            writer.write(np.zeros((40, 48, 3), np.uint8))
    return fakes.write_prepared(folder / "clip.mkv", folder)


USUAL = np.full((H, W), 0.03, np.float32)
OBJECT = np.s_[50:80, 36:48]  # over the chin, the lower lip, and beyond the face


def overlap(found: np.ndarray, thing: tuple[slice, slice]) -> float:
    true = np.zeros((H, W), bool)
    true[thing] = True
    return float((found & true).sum() / (found | true).sum())


def test_nothing_lies_over_a_face_that_speaks() -> None:
    assert not unexplained(face(), USUAL).any()
    assert not is_awry(face(), USUAL)


@pytest.mark.parametrize("edge", [6.0, 12.0])
def test_a_shadow_on_a_part_of_a_face_is_no_thing(edge: float) -> None:
    size = 256
    columns = np.arange(size) - size / 2
    head = np.full((size, size, 3), SKIN, np.float32) / 255
    dark = 1 / (1 + np.exp(-np.clip(columns / edge, -30, 30)))
    image = (255 * head * (1 - dark[:, None] * (0.62, 0.6, 0.57))).round().astype(np.uint8)

    def found(film: np.ndarray) -> int:
        seen = compare(film, fakes.talking_face(size), head, np.ones((size, size)), np.zeros(3))
        return int(unexplained(seen, np.zeros((H, W), np.float32)).sum())

    thing = image.copy()
    cv2.circle(thing, (size // 2 - 25, 180), 14, DARK, -1)  # 66 px of the frame of the face
    assert found(image) < 10
    assert found(thing) > 50


def test_a_mask_over_mouth_and_chin_is_no_grade() -> None:
    size = 256
    rows, columns = np.mgrid[:size, :size] / size
    shading = 1 + 0.15 * np.sin(9 * columns) * np.cos(7 * rows)
    head = (shading[..., None] * np.array(SKIN) / 255).astype(np.float32)
    image = (255 * head).round().astype(np.uint8)
    masked = image.copy()
    pleats = 1 + 0.1 * np.sin(60 * rows)[..., None]
    masked[120:] = (pleats * (150, 190, 215))[120:].round()

    def seen(film: np.ndarray) -> Compared:
        return compare(film, fakes.talking_face(size), head, np.ones((size, size)), np.zeros(3))

    none = np.zeros((H, W), np.float32)
    assert not unexplained(seen(image), none).any()
    assert np.isfinite(seen(image).grade).all()
    covered = seen(masked)
    assert np.isnan(covered.grade).all()
    assert unexplained(covered, none)[covered.known].mean() > 0.3  # seeds of a cut by colours


def test_what_the_head_explains_is_not_covered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the head is not known, a lower face of unusual colours stays covered."""

    class Explained:
        def __init__(self, *_: object) -> None:
            pass

        def look(self, frames: np.ndarray) -> list[Compared]:
            return [face() for _ in frames]

    known = torch.tensor([1.0, 1.0, 1.0, 0.0])
    monkeypatch.setattr(covers, "Comparison", Explained)
    monkeypatch.setattr(covers, "method_of", lambda _: None)
    monkeypatch.setattr(covers, "trust", lambda *_: known)
    clip = replace(film(tmp_path, 4), covered=np.array([False, True, True, True]))
    clip, over = covers._covers(cast("Any", None), None, clip, lambda *_: None)
    assert not over
    np.testing.assert_array_equal(clip.covered, [False, False, False, True])


def test_what_is_small_on_a_face_is_small_on_a_profile_that_is_shown_larger() -> None:
    shadow = face(np.s_[30:38, 20:28])
    assert unexplained(shadow, USUAL).any()
    assert not unexplained(replace(shadow, zoom=2.0), USUAL).any()
    assert unexplained(replace(face(OBJECT), zoom=2.0), USUAL).any()


def test_a_thing_is_found_as_a_whole() -> None:
    compared = [face(OBJECT, k) for k in range(5)]
    seeds = steady([unexplained(c, USUAL) for c in compared])
    assert all(s.any() for s in seeds)
    assert not (seeds[0] & LIPS).any()
    for found in followed(compared, seeds):
        assert overlap(found, OBJECT) > 0.85  # on the lips, and below the chin


def test_a_frame_takes_on_what_its_neighbours_show() -> None:
    """A thing that hides nothing but the lips in one frame."""
    over_lips = np.s_[46:55, 38:50]
    compared = [face(OBJECT, 1), face(OBJECT, 2), face(over_lips, 3), face(OBJECT, 4)]
    seeds = [unexplained(c, USUAL) for c in compared]
    assert not seeds[2].any()
    found = followed(compared, seeds)
    assert overlap(found[2] & LIPS, over_lips) > 0.5


def test_an_open_mouth_is_no_part_of_a_thing_as_dark() -> None:
    """It is open in two frames, of a thing that stays."""
    open_mouth = np.s_[46:54, 46:58]
    compared = [face(OBJECT, k) for k in range(12)]
    for c in compared[5:7]:
        c.picture[open_mouth] = DARK
        c.apart[open_mouth] = 1.0
    found = followed(compared, steady([unexplained(c, USUAL) for c in compared]))
    beside = np.s_[46:54, 52:58]
    assert found[5][50:54, 38:46].mean() > 0.9
    assert found[5][beside].mean() < 0.1


def test_a_shine_bites_nothing_off_a_thing() -> None:
    compared = [face(OBJECT, k) for k in range(5)]
    for c in compared:
        c.picture[56:60, 37:39] = SKIN
        c.apart[56:60, 37:39] = 0
    found = followed(compared, steady([unexplained(c, USUAL) for c in compared]))
    assert found[2][57:59, 38:39].all()


@pytest.mark.parametrize("on_lips", [True, False])
def test_a_gap_between_a_thing_and_lips_is_no_bite(on_lips: bool) -> None:
    thing, lips = np.zeros((2, H, W), bool)
    thing[40:60, 30:50], thing[48:52, 30:34], lips[40:60, 30:50] = True, False, on_lips
    assert whole(thing, lips)[49:51, 32:34].any() != on_lips


def test_what_flashes_up_is_chance() -> None:
    something, nothing = np.ones((H, W), bool), np.zeros((H, W), bool)
    alone = [nothing] * 4 + [something] + [nothing] * 4
    assert not any(s.any() for s in steady(alone))
    lasting = [nothing] * 3 + [something] * 4 + [nothing] * 3
    assert [s.any() for s in steady(lasting)] == [s.any() for s in lasting]


@pytest.mark.parametrize("frames", [1, 2, 4])
def test_short_runs_are_looked_at_too(frames: int) -> None:
    compared = [face(OBJECT, k) for k in range(frames)]
    seeds = steady([unexplained(c, USUAL) for c in compared])
    assert [s.any() for s in seeds] == [frames >= 3] * frames
    assert len(followed(compared, seeds)) == frames


def test_places_that_always_differ_are_usual() -> None:
    """A mole that the head does not have."""
    compared = face(np.s_[20:26, 20:26])
    usual = usual_difference(np.stack([compared.apart] * 9))
    assert not unexplained(compared, usual).any()


def test_a_thing_that_is_there_all_through_a_shot_is_not_usual() -> None:
    thing, shade = face(OBJECT), face(OBJECT)
    shade = replace(shade, apart=np.minimum(shade.apart, 0.4))
    for compared, found in ((thing, True), (shade, False)):
        usual = usual_difference(np.stack([compared.apart] * 9))
        assert not unexplained(compared, usual).any()
        assert unexplained(compared, np.minimum(usual, MOST_USUAL)).any() == found


def test_a_head_that_does_not_lie_on_the_face() -> None:
    compared = face()
    assert is_awry(replace(compared, apart=compared.apart + 0.15), USUAL)


def test_what_has_the_colours_of_a_face_is_told_from_it_as_a_hand_alone() -> None:
    thing, hand = np.zeros((H, W), bool), np.zeros((21, 3))
    thing[OBJECT] = True
    dark, like_skin = face(OBJECT), face()
    like_skin.picture[OBJECT] = (185, 138, 120)
    assert not is_like_skin(dark, thing)
    assert is_like_skin(like_skin, thing)
    cover = told_apart(dark, thing, thing, [], [], USUAL)
    assert cover is not None
    np.testing.assert_array_equal(cover.pixels, thing)
    assert told_apart(like_skin, thing, thing, [], [], USUAL) is None
    cover = told_apart(like_skin, thing, np.zeros_like(thing), [hand], [thing], USUAL)
    assert cover is not None
    assert not cover.pixels.any()
    assert cover.hands == [hand]


def test_a_half_of_a_face_that_a_lamp_leaves_dark_is_skin() -> None:
    """All through a shot, and with a side of the nose: hair has the same colours."""
    half, strand = np.s_[14:70, 46:74], np.s_[14:70, 56:74]
    brown, black, grey = (45, 30, 26), (12, 9, 8), (30, 30, 30)
    for thing, colour, found in (
        (half, brown, False),
        (half, black, False),
        (half, grey, True),
        (strand, brown, True),
    ):
        over, seen = np.zeros((H, W), bool), face(thing)
        over[thing], seen.picture[thing] = True, colour
        assert not is_like_skin(seen, over)
        lasting = np.where(over, 0.6, USUAL)
        assert (told_apart(seen, over, over, [], [], lasting) is not None) == found
        assert told_apart(seen, over, over, [], [], USUAL) is not None


def test_a_shine_on_a_thing_is_part_of_it() -> None:
    """A cut by colours leaves it out, though nothing but the thing lies there."""
    thing, shine = np.zeros((2, H, W), bool)
    thing[OBJECT] = True
    shine[52:58, 36:40] = True
    seen = face(OBJECT)
    seen.picture[shine] = (250, 250, 250)
    cover = told_apart(seen, thing & ~shine, thing & ~shine, [], [], USUAL)
    assert cover is not None
    np.testing.assert_array_equal(cover.pixels, thing)
    # Skin that the head explains is none of it, even where it lies in a bend of the thing.
    seen.apart[shine] = 0
    cover = told_apart(seen, thing & ~shine, thing & ~shine, [], [], USUAL)
    assert cover is not None
    np.testing.assert_array_equal(cover.pixels, thing & ~shine)


def test_skin_beside_what_lies_over_a_face_is_skin() -> None:
    """Teeth and a cheek in the shade differ from the head, too."""
    thing, cheek, hand, teeth = np.zeros((4, H, W), bool)
    thing[OBJECT] = cheek[30:38, 18:28] = hand[66:80, 40:50] = teeth[46:49, 50:56] = True
    both = thing | cheek | teeth
    cover = told_apart(face(OBJECT), both, both, [], [], USUAL)
    assert cover is not None
    np.testing.assert_array_equal(cover.pixels, thing)
    like_skin = face()
    like_skin.picture[OBJECT] = (185, 138, 120)
    cover = told_apart(like_skin, both, both, [np.zeros((21, 3))], [hand], USUAL)
    assert cover is not None
    np.testing.assert_array_equal(cover.pixels, thing)


def test_a_graphic_that_is_known_has_the_edges_that_are_known() -> None:
    """A cut in the frame of the face would take lips beside it along."""
    landmarks = np.zeros((478, 2))
    landmarks[[33, 263]] = (96, 96), (180, 96)  # a crop three times as large
    told = np.zeros((300, 300), np.uint8)
    turn = cv2.invertAffineTransform(to_face(landmarks))
    places = np.array([[10.0, 56], [78, 68]]) @ turn[:, :2].T + turn[:, 2]
    (left, top), (right, bottom) = places.round().astype(int)
    told[top:bottom, left:right] = 255
    coarse, thing, bare = np.zeros((3, H, W), bool)
    coarse[52:70, 12:76] = thing[26:34, 20:30] = bare[40:54] = True
    assert not beside_told(coarse, told, landmarks, bare).any()
    np.testing.assert_array_equal(beside_told(coarse | thing, told, landmarks, bare), thing)
    # Of a thing that is known in part the cut tells the rest,
    thing[26:56, 20:30] = True
    both = coarse | thing
    assert beside_told(both, told, landmarks, bare)[thing].all()
    # even where that is the smaller part, as the band of a cup; but not lips beside it.
    told[top + 15 : top + 30] = 0
    np.testing.assert_array_equal(
        beside_told(coarse, told, landmarks, bare)[61:66, 20:70], np.ones((5, 50))
    )
    assert not beside_told(coarse, told, landmarks, bare)[52:54].any()


def test_a_shade_hides_no_face() -> None:
    thing, shade = np.zeros((2, H, W), bool)
    thing[OBJECT] = True
    shade[60:66, 40:48] = True
    assert is_large(face(), thing)
    assert not is_large(face(), shade)
    assert not is_large(replace(face(), zoom=3.0), thing)  # a profile, shown larger


def test_a_mask_follows_the_picture() -> None:
    landmarks = fakes.face(256)
    image = np.full((256, 256, 3), SKIN, np.uint8)
    cv2.circle(image, (128, 150), 30, DARK, -1)
    coarse = np.zeros((256, 256), np.float32)
    cv2.circle(coarse, (130, 152), 28, 1.0, -1)  # a little off
    over = cv2.warpAffine(coarse, to_face(landmarks), (W, H)) > 0.5
    mask = mask_of(over, image, landmarks)
    true = np.hypot(*(np.indices((256, 256))[::-1] - np.array([128, 150])[:, None, None])) < 30
    assert mask[true].mean() > 0.99 * 255
    assert mask[~cv2.dilate(true.astype(np.uint8), np.ones((9, 9))).astype(bool)].max() < 40


def test_frames_in_a_row_are_looked_at_together() -> None:
    runs = runs_of(np.array([3, 4, 5, 9, 10, 20]))
    assert [run.tolist() for run in runs] == [[3, 4, 5], [9, 10], [20]]
    assert runs_of(np.zeros(0, int)) == []


def test_a_face_is_not_hidden_for_a_blink() -> None:
    assert lasting({3, 4, 5, 20, 21, 22, 23, 24, 25, 26, 27}, 7.5) == set(range(20, 28))
    assert lasting(set(), 7.5) == set()


class Looks:
    """How far the head of each frame lies beside the face, in place of what they look like."""

    blur, true = 0.2, 0.0

    def __init__(self, _method: object, _maps: object, clip: PreparedClip) -> None:
        self.clip = clip

    def look(self, frames: np.ndarray) -> Iterator[float]:
        for t in frames:
            off = abs(float(self.clip.translation[t, 0]) - self.true * (t == SHAKEN))
            yield off + self.blur * (t == SHAKEN)


SHAKEN = 4  # a frame whose head is blurred


@pytest.mark.parametrize("true", [0.0, 0.5])
def test_a_pose_becomes_that_between_others_where_the_head_then_lies_better(
    true: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = film(tmp_path, 9)
    clip.translation[SHAKEN, 0] = 0.5
    monkeypatch.setattr(Looks, "true", true)
    monkeypatch.setattr(mended_poses, "Comparison", Looks)
    monkeypatch.setattr(mended_poses, "off_by", lambda compared, _: compared)
    monkeypatch.setattr(mended_poses, "refined", lambda _model, _maps, clip, _frames: clip)
    method = cast(Method[Any, Any], SimpleNamespace(model=None))
    found, awry = mended_poses.with_poses_mended(method, None, clip, np.arange(9), USUAL)
    assert awry == {SHAKEN}
    np.testing.assert_allclose(found.translation[:, 0], clip.translation[:, 0] * (true > 0))
    assert clip.translation[SHAKEN, 0] == 0.5
