"""Verdicts and words."""

import json
from dataclasses import replace

import pytest
from pydantic import TypeAdapter

from dubbing.sync.closeness import Closeness
from dubbing.sync.curves import Estimate
from dubbing.sync.judgement import film_face, judge, pass_closeness, sound_offset, unjudgeable
from dubbing.sync.result import FaceResult, Figures, Media, Segment, SyncResult

MOVING = Figures(0.2, 0.7, 0.6, 0.05, 0.05, 0.3, 0.1, 0.4, None)
STILL = replace(MOVING, spread=0.002)
FACTS = Media(100, "25", 4.0, 4.0, 3.0, 4.0)
FILM = FaceResult(0, 0.5, 0.5, 4.0, 0, 0.2, MOVING)


@pytest.mark.parametrize(
    ("offset", "ms", "confidence", "figures", "expected"),
    [
        (0, 0, 0.20, MOVING, ("pass", "In sync.")),
        (1, 40, 0.13, MOVING, ("pass", "65 %")),
        (-1, -40, 0.20, None, ("pass", "real speakers")),
        # Two frames at 60 fps are 33 ms: nobody sees that.
        (2, 33, 0.20, MOVING, ("pass", "In sync.")),
        (2, 80, 0.20, MOVING, ("warn", "early by 2 frames (80 ms)")),
        (-3, -120, 0.20, MOVING, ("warn", "late by 3 frames (120 ms)")),
        # ITU-R BT.1359 accepts sound that is early less than sound that is late.
        (3, 120, 0.20, MOVING, ("fail", "early by 3 frames (120 ms)")),
        (-4, -160, 0.20, MOVING, ("fail", "late by 4 frames (160 ms)")),
        (0, 0, 0.10, MOVING, ("warn", "50 %")),
        (0, 0, 0.05, MOVING, ("fail", "follow")),
        (9, 360, 0.05, MOVING, ("fail", "follow")),
        (0, 0, 0.20, STILL, ("fail", "hardly moves")),
    ],
)
def test_verdicts_without_a_film(
    offset: int, ms: float, confidence: float, figures: Figures | None, expected: tuple[str, str]
) -> None:
    verdict, reason = judge(Estimate(offset, confidence, 1.0), ms, figures, typical=0.2)
    assert verdict == expected[0], reason
    assert expected[1] in reason


@pytest.mark.parametrize(
    ("number", "parts", "seconds", "expected"),
    [
        (0.94, {}, 20, ("pass", "In sync. The mouth follows the words: 94 % of the original.")),
        (0.88, {}, 3, ("pass", "88 %")),
        (0.88, {"range": 0.3}, 20, ("warn", "opens more or less than in the film, look at it: 88")),
        (0.78, {"sharpness": 0.4}, 3, ("warn", "softer or sharper")),
        (0.45, {"closures": 0.0}, 3, ("fail", "do not close")),
        # Neither network finds the words, wherever the other parts are.
        (
            0.8,
            {"certainty": 0.4, "opening": 0.5},
            3,
            ("fail", "does not follow these words: 100 %"),
        ),
    ],
)
def test_verdicts_beside_a_film(
    number: float, parts: dict[str, float], seconds: float, expected: tuple[str, str]
) -> None:
    near = Closeness(number, {"certainty": 1.0, "opening": 1.0} | parts)
    verdict, reason = judge(Estimate(0, 0.2, 1.0), 0, MOVING, FILM, near, seconds=seconds)
    assert verdict == expected[0], reason
    assert expected[1] in reason


def test_words_that_are_late_are_these_words_still() -> None:
    near = Closeness(0.8, {"certainty": 0.4, "opening": 0.4})
    assert judge(Estimate(-3, 0.2, 1.0), -120, MOVING, FILM, near)[0] == "warn"
    assert judge(Estimate(3, 0.2, 1.0), 120, MOVING, FILM, near)[0] == "fail"
    verdict, reason = judge(Estimate(-3, 0.1, 1.0), -120, MOVING, FILM, near)
    assert verdict == "fail"
    assert "does not follow" in reason


def test_more_seconds_must_be_closer() -> None:
    needed = [pass_closeness(seconds) for seconds in (1, 3, 5, 60)]
    assert needed[0] == needed[1] < needed[2] < needed[3] < 1


def test_a_slow_clip_may_be_one_frame_off() -> None:
    assert judge(Estimate(1, 0.2, 1.0), 1000 / 12, MOVING)[0] == "pass"


def test_a_dub_is_compared_with_the_face_of_the_film_that_is_in_its_place() -> None:
    left, right = replace(FILM, column=0.2), replace(FILM, column=0.8)
    source = SyncResult("pass", "", "a", FACTS, faces=[left, right])
    assert film_face(source, "a", (0.3, 0.5)) is left
    assert film_face(source, "a", (0.7, 0.5)) is right
    assert film_face(source, "b", (0.3, 0.5)) is None, "measured in another way"
    assert film_face(None, "a", (0.3, 0.5)) is None
    unsure = replace(source, faces=[replace(left, confidence=0.05), right])
    assert film_face(unsure, "a", (0.3, 0.5)) is None, "a face that does not follow its own sound"
    short = replace(source, faces=[replace(left, seconds=0.5), right])
    assert film_face(short, "a", (0.3, 0.5)) is right


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"picture_seconds": 2.9}, "2.9 s long"),
        ({"sound_seconds": 1.0}, "1.0 s long"),
        ({"speech_seconds": 0.5}, "no speech"),
        ({"mouth_seconds": 1.5}, "1.5 s only"),
    ],
)
def test_what_cannot_be_judged(change: dict[str, float], reason: str) -> None:
    assert unjudgeable(FACTS, True) is None
    assert reason in (unjudgeable(replace(FACTS, **change), True) or "")  # type: ignore[arg-type]


def test_no_face_cannot_be_judged() -> None:
    assert unjudgeable(FACTS, False) == "no face was found"


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        (2, "audio early by 2 frames (80 ms)"),
        (-1, "audio late by 1 frame (40 ms)"),
        (0, "in sync"),
        (None, "not measured"),
    ],
)
def test_words(frames: int | None, words: str) -> None:
    ms = None if frames is None else frames * 40.0
    result = SyncResult("pass", "", "m", FACTS, offset_frames=frames, offset_ms=ms)
    assert result.words == words
    assert replace(result, verdict="fail").words == words.replace("in sync", "no offset")
    assert result.to_json()["words"] == words


def test_json_round_trip() -> None:
    source = SyncResult("pass", "fine", "m", FACTS, offset_frames=0, offset_ms=0.0, faces=[FILM])
    segment = Segment(0, 4, None, None, None, 0.5, closeness=0.9, parts={"range": 0.8})
    result = replace(source, closeness=0.9, segments=[segment], source=source)
    text = json.dumps(result.to_json())
    assert TypeAdapter(SyncResult).validate_json(text) == result


@pytest.mark.parametrize(
    ("offset", "confidence", "known"),
    [(3, 0.5, 3), (-2, 0.2, -2), (1, 0.5, 1), (0, 0.5, 0), (4, 0.05, 0), (None, None, 0)],
)
def test_sound_is_moved_only_when_it_is_surely_off(
    offset: int | None, confidence: float | None, known: int
) -> None:
    result = SyncResult("warn", "", "lips", FACTS, offset_frames=offset, confidence=confidence)
    assert sound_offset(result) == known
