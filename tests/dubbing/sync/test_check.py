"""The whole check on the pixels of the synthetic speaker, whose truth is exact."""

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing.engine.disk.pieces import Pieces
from dubbing.errors import MediaError
from dubbing.face.finding.face_finder import FaceFinder
from dubbing.media import VideoWriter
from dubbing.media.reading.late_frames import Reader
from dubbing.provenance.card import draw
from dubbing.sync import measure
from dubbing.sync.check import check
from dubbing.sync.network.channels import SoundChannels
from dubbing.sync.sums import segment_edges
from tests.dubbing.conftest import Speaker

pytestmark = pytest.mark.medium


FRAME = 640  # samples at 16 kHz and 25 fps
Write = Callable[[np.ndarray], Path]


def shifted(sound: np.ndarray, early: int) -> np.ndarray:
    """The sound heard `early` frames earlier, silence where it has none."""
    moved = np.zeros_like(sound)
    if early >= 0:
        moved[: len(sound) - early * FRAME] = sound[early * FRAME :]
    else:
        moved[-early * FRAME :] = sound[: early * FRAME]
    return moved


def test_a_clip_in_sync_passes_and_so_it_does_with_a_card_after_it(
    speaker: Speaker, silent_video: Write, sound_file: Write
) -> None:
    result = check(speaker.clip)
    # Neither its face nor its text was learned from.
    assert result.offset_frames == 0
    assert result.verdict == "pass"
    assert result.media.frames == 100
    assert result.media.picture_seconds == pytest.approx(4.0, abs=0.01)
    assert result.media.sound_seconds == pytest.approx(4.0, abs=0.1)
    assert result.closeness is None  # there is no film to compare with
    assert len(result.curve) == len(result.curve_offsets) == 31
    best = int(np.argmin(result.curve))
    assert result.curve_offsets[best] == result.offset_frames
    assert result.distance == pytest.approx(result.curve[best])
    assert result.confidence == pytest.approx(np.median(result.curve) - result.curve[best])
    assert [s.end for s in result.segments] == [4.0]
    again = json.loads(json.dumps(result.to_json()))
    assert again["verdict"] == "pass"
    assert again["source"] is None
    card = np.repeat(draw("AI-dubbed", 96, 96)[None], 50, 0)
    video = silent_video(np.concatenate([speaker.frames, card]))
    longer = sound_file(np.concatenate([speaker.sound[: 100 * FRAME], np.zeros(50 * FRAME)]))
    found = check(video, sound_from=longer, leave_out=50)
    assert (found.verdict, found.offset_frames) == ("pass", 0)
    assert found.curve == pytest.approx(result.curve, abs=0.05)
    assert found.media.frames == 100
    assert found.media.picture_seconds == result.media.picture_seconds
    assert found.media.sound_seconds == pytest.approx(4.0, abs=0.1)
    assert [s.end for s in found.segments] == [4.0]


@pytest.mark.parametrize("early", [-9, 7])
def test_the_sign_of_a_shift(speaker: Speaker, sound_file: Write, early: int) -> None:
    truth = check(speaker.clip)
    assert truth.offset_frames is not None
    result = check(speaker.clip, sound_from=sound_file(shifted(speaker.sound, early)), source=truth)
    assert result.offset_frames is not None
    assert result.offset_frames == pytest.approx(truth.offset_frames + early, abs=1)
    assert result.offset_ms == result.offset_frames * 40
    assert ("early" if early > 0 else "late") in result.words
    assert result.verdict == "fail"
    assert result.words in result.reason or "follow" in result.reason
    assert result.source is truth


def test_a_frozen_mouth_fails(speaker: Speaker, silent_video: Write, sound_file: Write) -> None:
    """Noise as a camera has, so that landmarks shake: still no mouth that moves."""
    rng = np.random.default_rng(0)
    frames = speaker.frames[40:41] + rng.normal(0, 2, speaker.frames.shape)
    video = silent_video(np.clip(np.round(frames), 0, 255).astype(np.uint8))
    result = check(video, sound_from=sound_file(speaker.sound))
    assert result.verdict == "fail"
    assert "hardly moves" in result.reason


def test_the_speaking_face_of_two(speaker: Speaker, silent_video: Write, sound_file: Write) -> None:
    """Left: the same person talking backwards; right: what one hears."""
    both = np.concatenate([speaker.frames[::-1], speaker.frames], axis=2)
    result = check(silent_video(both), sound_from=sound_file(speaker.sound))
    assert len(result.faces) == 2
    spoken = next(f for f in result.faces if f.track == result.speaking_face)
    assert spoken.column > 0.5
    assert result.offset_frames is not None
    assert abs(result.offset_frames) <= 1


def test_unjudged_with_the_reason(speaker: Speaker, silent_video: Write, sound_file: Write) -> None:
    silent = silent_video(speaker.frames)
    assert "no sound" in check(silent).reason
    quiet = check(silent, sound_from=sound_file(0 * speaker.sound))
    assert (quiet.verdict, quiet.offset_frames) == ("unjudged", None)
    assert "no speech" in quiet.reason
    assert quiet.words == "not measured"
    short = check(speaker.clip, sound_from=sound_file(speaker.sound[:32_000]))
    assert short.verdict == "unjudged"
    assert "2.0 s" in short.reason
    empty = check(silent_video(0 * speaker.frames), sound_from=sound_file(speaker.sound))
    assert empty.verdict == "unjudged"
    assert "no face" in empty.reason


def test_blocks_change_little(speaker: Speaker, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = check(speaker.clip)
    monkeypatch.setattr(measure, "BLOCK_SECONDS", 2.0)
    parts = check(speaker.clip)
    assert whole.offset_frames is not None
    assert parts.offset_frames is not None
    assert abs(parts.offset_frames - whole.offset_frames) <= 1
    assert parts.media == whole.media
    assert parts.confidence == pytest.approx(whole.confidence, abs=0.05)


def test_what_stays_is_not_measured_again(
    speaker: Speaker, sound_file: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, listened = [], []
    follow, extract = FaceFinder.follow, SoundChannels.extract

    def counted(*of: Any) -> list[np.ndarray]:
        looks.append(of)
        return follow(*of)

    def heard(*of: Any) -> np.ndarray:
        listened.append(of)
        return extract(*of)

    def number(
        frames: np.ndarray, name: str, last: str, made_by: str = "this code"
    ) -> tuple[int, int]:
        del looks[:], listened[:]
        with VideoWriter(tmp_path / f"{name}.mkv", 96, 96, Fraction(25), "ffv1") as writer:
            for frame in frames:
                writer.write(frame)
        pieces = Pieces(tmp_path / name, tmp_path / last if last else None, made_by)
        found = check(writer.path, sound_from=sound, pieces=pieces)
        counts = len(looks), len(listened)
        assert found == check(writer.path, sound_from=sound)
        return counts

    monkeypatch.setattr(FaceFinder, "follow", counted)
    monkeypatch.setattr(SoundChannels, "extract", heard)
    sound, changed = sound_file(speaker.sound), speaker.frames.copy()
    changed[10:20] = changed[9]
    assert number(speaker.frames, "one", "") == (100, 1)
    # From the group of 12 frames that holds the first of them to the end of the run.
    assert number(changed, "two", "one") == (50, 0)
    sound = sound_file(shifted(speaker.sound, 1))
    assert number(changed, "three", "two") == (0, 1)
    assert number(changed, "four", "three", "other code") == (100, 1)


def test_block_lengths() -> None:
    assert measure.block_lengths(100, measure.Fraction(25)) == [100]
    lengths = measure.block_lengths(4001, measure.Fraction(25))
    assert sum(lengths) == 4001
    assert max(lengths) <= 1500
    assert max(lengths) - min(lengths) <= 1


def test_segments_of_five_seconds() -> None:
    assert segment_edges(100, 25) == [0, 100]
    assert segment_edges(300, 25) == [0, 125, 300]
    assert segment_edges(330, 25) == [0, 125, 250, 330]


def test_a_file_without_picture(sound_file: Write) -> None:
    path = sound_file(np.zeros(64_000))
    with pytest.raises(MediaError, match="picture"):
        check(path)


def test_parts_are_judged_by_themselves(speaker: Speaker, sound_file: Write) -> None:
    """What lies outside of the parts does not count: here it does not belong at all."""
    sound = speaker.sound.copy()
    sound[80 * FRAME :] = sound[: 20 * FRAME][::-1]
    result = check(speaker.clip, sound_from=sound_file(sound), parts=[(0, 78), (78, 80)])
    long, short = result.segments
    assert (long.start, long.end) == (0.0, 78 / 25)
    assert (long.verdict, long.offset_frames) == ("pass", 0)
    assert short.verdict == "unjudged"
    assert "only 0.1 s long" in short.reason
    assert result.media.picture_seconds == 3.2


def test_blocks_beside_the_parts_are_not_looked_at(
    speaker: Speaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measure, "BLOCK_SECONDS", 1.0)
    read: list[int] = []

    def noting(self: Reader, number: int) -> np.ndarray:
        read.append(number)
        return one(self, number)

    one = Reader.read
    monkeypatch.setattr(Reader, "read", noting)
    result = check(speaker.clip, parts=[(25, 100)])
    assert {*read} == {*range(25, 100)}
    assert result.offset_frames == 0


def test_voices_are_listened_to_when_they_are_heard(speaker: Speaker, sound_file: Write) -> None:
    """The voices by themselves lie elsewhere than in the sound of the video: a fault of a mux."""
    truth = check(speaker.clip)
    found = check(speaker.clip, voices=sound_file(shifted(speaker.sound, 7)), source=truth)
    assert (found.verdict, found.offset_frames) == ("pass", 0)
    assert found.closeness == pytest.approx(1, abs=0.05)
    lost = check(speaker.clip, voices=sound_file(speaker.sound[::-1]), source=truth)
    assert (lost.verdict, lost.reason) == ("fail", "The voices are not heard in the video.")
