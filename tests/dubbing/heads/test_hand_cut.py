"""Hands are found, and cut out of a face that has their colours."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import pytest

from dubbing.face.finding.hand_finder import POINTS, WRIST, HandFinder
from dubbing.heads import hand_cut
from dubbing.heads.comparison import EYES, Compared, H, W, to_face
from dubbing.heads.hand_cut import EVERY, hand_mask, lies_over, without_hands
from dubbing.identity.clip_frames import ClipFrames
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.workshop.true_dubs import objects
from tests import fakes

SIZE = 320
FRAMES = (140, 150, 160)  # in which the hand is up


@dataclass(frozen=True)
class Clip:
    """As much of a prepared clip as is asked for."""

    landmarks: np.ndarray
    detected: np.ndarray

    def __len__(self) -> int:
        return len(self.detected)


LIPS = np.zeros((H, W), bool)
LIPS[44:56, 30:58] = True
FACE = np.zeros((H, W), bool)
FACE[24:76, 14:74] = True


def skin(size: int = SIZE) -> np.ndarray:
    """Nothing but skin, darker towards its right, with noise."""
    tone = np.array([205.0, 158, 134]) - 30 * np.arange(size)[:, None] / size
    noise = np.random.default_rng(0).normal(0, 2, (size, size, 3))
    return np.clip(tone + noise, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def covers() -> list[objects.Cover]:
    return [objects.hand(t, np.array([160.0, 130.0]), SIZE) for t in FRAMES]


@pytest.fixture(scope="module")
def hands(covers: list[objects.Cover]) -> list[np.ndarray]:
    found = HandFinder().follow(cover.over(skin()) for cover in covers)
    assert [len(some) for some in found] == [1, 1, 1]
    return [hand for (hand,) in found]


def test_there_is_no_hand_on_skin_alone() -> None:
    assert HandFinder().follow([skin()]) == [[]]


def test_a_hand_on_skin_is_cut_out(covers: list[objects.Cover], hands: list[np.ndarray]) -> None:
    for cover, hand in zip(covers, hands, strict=True):
        assert hand.shape == (POINTS, 3)
        mask = hand_mask(cover.over(skin()), [hand]) / 255
        both = np.minimum(mask, cover.opacity).sum() / np.maximum(mask, cover.opacity).sum()
        assert both > 0.88


def test_a_larger_picture_is_cut_as_well(hands: list[np.ndarray]) -> None:
    cover = objects.hand(FRAMES[0], np.array([480.0, 390.0]), 3 * SIZE)
    mask = hand_mask(cover.over(skin(3 * SIZE)), [3 * hands[0]]) / 255
    both = np.minimum(mask, cover.opacity).sum() / np.maximum(mask, cover.opacity).sum()
    assert both > 0.88


def test_a_hand_counts_where_the_head_does_not_explain_it(hands: list[np.ndarray]) -> None:
    landmarks = fakes.face(SIZE)
    turn = to_face(landmarks)
    at_lips = np.linalg.solve(turn[:, :2], np.argwhere(LIPS).mean(0)[::-1] - turn[:, 2])
    hand = hands[1].copy()
    hand[:, :2] += at_lips - hand[9, :2]
    picture, apart = np.zeros((H, W, 3), np.uint8), np.full((H, W), 0.3, np.float32)
    seen = Compared(picture, apart, FACE & ~LIPS, LIPS, FACE & ~LIPS, np.zeros_like(FACE))
    assert lies_over(hand, seen, landmarks)
    assert not lies_over(hand, replace(seen, apart=np.zeros_like(apart)), landmarks)
    assert not lies_over(hand + np.array([0, 2 * SIZE, 0]), seen, landmarks)
    # A mouth that is wide open looks like a fist: its wrist would lie on the face, or at its edge.
    fist = 0.3 * (hand - hand[9]) + [*landmarks[13], 0]
    assert not lies_over(fist, seen, landmarks)
    edge = landmarks[landmarks[:, 1].argmax()] + [0, 0.05 * EYES / np.hypot(*turn[0, :2])]
    fist[:, :2] += edge - fist[WRIST, :2]
    assert not lies_over(fist, seen, landmarks)


@pytest.mark.parametrize(("shown", "dropped"), [([10], range(6, 15)), ([], []), ([0, 10, 20], [])])
def test_frames_with_a_hand_before_the_mouth_are_not_learned(
    hands: list[np.ndarray],
    shown: list[int],
    dropped: Sequence[int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where most of them show one they are learned: the finder may be wrong, and few are left."""
    landmarks = np.stack([fakes.face(SIZE)] * 25)
    hand = hands[1].copy()
    hand[:, :2] += landmarks[0, 13] - hand[9, :2]
    clip = cast(PreparedClip, Clip(landmarks, np.ones(25, bool)))
    pictures = [
        skin() if t not in shown else np.zeros((SIZE, SIZE, 3), np.uint8) for t in range(25)
    ]
    monkeypatch.setattr(hand_cut, "images", lambda _, frames: [pictures[t] for t in frames])
    monkeypatch.setattr(
        HandFinder, "follow", lambda _, images: [[] if x.any() else [hand] for x in images]
    )
    footage = ClipFrames(clip, cast(SpeechFrames, None), np.arange(25))
    left = without_hands(footage)
    assert EVERY == 5
    np.testing.assert_array_equal(left.with_face, np.setdiff1d(np.arange(25), dropped))
    np.testing.assert_array_equal(left.frames, footage.frames)
