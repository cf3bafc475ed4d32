"""Verdicts and words."""

import json
from dataclasses import replace

import pytest
from pydantic import TypeAdapter

from dubbing.sync.curves import Estimate
from dubbing.sync.judgement import judge, reference_confidence, sound_offset, unjudgeable
from dubbing.sync.result import Media, Motion, Segment, SyncResult

MOVING = Motion(0.1, True, False, 0.3, 0.05)
STILL = Motion(0.01, False, None, 0.02, None)
FACTS = Media(100, "25", 4.0, 4.0, 3.0, 4.0)


@pytest.mark.parametrize(
    ("offset", "ms", "confidence", "motion", "expected"),
    [
        (0, 0, 0.20, MOVING, ("pass", "offset 0")),
        (1, 40, 0.13, MOVING, ("pass", "65%")),
        (-1, -40, 0.20, None, ("pass", "source")),
        # Two frames at 60 fps are 33 ms: nobody sees that.
        (2, 33, 0.20, MOVING, ("pass", "offset 2")),
        (2, 80, 0.20, MOVING, ("warn", "early by 2 frames (80 ms)")),
        (-3, -120, 0.20, MOVING, ("warn", "late by 3 frames (120 ms)")),
        (-4, -160, 0.20, MOVING, ("fail", "late by 4 frames (160 ms)")),
        (0, 0, 0.10, MOVING, ("warn", "50%")),
        (0, 0, 0.05, MOVING, ("fail", "follow")),
        (9, 360, 0.05, MOVING, ("fail", "follow")),
        (0, 0, 0.20, STILL, ("fail", "hardly moves")),
    ],
)
def test_verdicts(
    offset: int, ms: float, confidence: float, motion: Motion | None, expected: tuple[str, str]
) -> None:
    verdict, reason = judge(Estimate(offset, confidence, 1.0), ms, motion, 0.2)
    assert verdict == expected[0], reason
    assert expected[1] in reason


@pytest.mark.parametrize(
    ("reference", "confidence", "expected"),
    [
        (0.40, 0.20, "pass"),  # half of a source that the network knows, and all a stranger has
        (0.40, 0.16, "warn"),
        (0.40, 0.11, "fail"),  # what does not follow is judged by the source's own confidence still
        (0.40, 0.35, "pass"),
        (0.28, 0.16, "warn"),
        (0.28, 0.17, "pass"),
        (0.20, 0.13, "pass"),
        (0.20, 0.11, "warn"),
    ],
)
def test_no_dub_is_requested_more_than_a_new_speaker_has(
    reference: float, confidence: float, expected: str
) -> None:
    verdict, reason = judge(Estimate(0, confidence, 1.0), 0, MOVING, reference)
    assert verdict == expected, reason
    if verdict != "fail":
        asked = (
            "the source's"
            if reference <= 0.28 or confidence > 0.24
            else "a clear unknown speaker's"
        )
        assert asked in reason


def test_a_slow_clip_may_be_one_frame_off() -> None:
    assert judge(Estimate(1, 0.2, 1.0), 1000 / 12, MOVING, 0.2)[0] == "pass"


def test_without_a_source_a_typical_confidence_stands_in() -> None:
    verdict, reason = judge(Estimate(0, 5.0, 7.0), 0, None, None, 6.0)
    assert verdict == "pass"
    assert "real speakers" in reason


def test_only_the_same_method_is_a_reference() -> None:
    source = SyncResult("pass", "", "a", FACTS, confidence=0.3)
    assert reference_confidence(source, "a") == 0.3
    assert reference_confidence(source, "b") is None
    assert reference_confidence(None, "a") is None


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
    source = SyncResult("pass", "fine", "m", FACTS, offset_frames=0, offset_ms=0.0, motion=STILL)
    result = replace(source, segments=[Segment(0, 4, None, None, None, 0.5)], source=source)
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
