"""Verdicts of the sync check, and their thresholds."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from dubbing.sync.curves import Estimate
from dubbing.sync.result import FaceResult, Media, Motion, Segment, SyncResult, Verdict

# A lip-sync error below 40 ms is not visible (ITU-R BT.1359: from +45 ms); at 25 fps this is one
# frame.
TOLERANCE_MS = 40.0
FAIL_MS = 125.0
# Shares of the confidence of the source clip.
PASS_SHARE = 0.6
FAIL_SHARE = 0.3
# Used in place of the source's confidence without a source: 60 % of it is the 95th percentile of
# unrelated speech, on people left out of training (docs/development/sync.md).
TYPICAL_CONFIDENCE = 0.15
# The highest confidence of people that the network was not trained on (docs/development/sync.md).
# People of the training data, and the synthetic speaker, can have .4. 60 % of that is more than
# most people have in their own clips, so a dub needs at most 60 % of this.
CLEAREST_CONFIDENCE = 0.28
MIN_SECONDS = 3.0
MIN_SPEECH_SECONDS = 1.0
MIN_MOUTH_SECONDS = 2.0


@dataclass(frozen=True)
class Measurement:
    """Measurement of the speaking face: estimate, curve over OFFSETS, frames a second."""

    best: Estimate
    curve: Sequence[float]
    rate: float
    face: int
    motion: Motion | None = None
    segments: list[Segment] = field(default_factory=list)
    faces: list[FaceResult] = field(default_factory=list)


def sound_offset(result: SyncResult) -> int:
    """Frames by which a clip's sound is early (negative: late); 0 where that is uncertain.

    It is 0 unless the confidence is higher than that of unrelated speech. A person fine-tuned on a
    clip with an offset would have the offset in every dub.
    """
    if result.offset_frames is None or result.confidence is None:
        return 0
    sure = result.confidence >= PASS_SHARE * TYPICAL_CONFIDENCE
    return result.offset_frames if sure else 0


def reference_confidence(source: SyncResult | None, method: str) -> float | None:
    """The source's confidence, if it was measured by the same method."""
    return source.confidence if source is not None and source.method == method else None


def unjudgeable(media: Media, tracked: bool) -> str | None:
    """Why a video cannot be judged, or None."""
    if min(media.picture_seconds, media.sound_seconds) < MIN_SECONDS:
        short = min(media.picture_seconds, media.sound_seconds)
        return f"only {short:.1f} s long, {MIN_SECONDS:.0f} s are needed"
    if media.speech_seconds < MIN_SPEECH_SECONDS:
        return f"no speech in the sound ({media.speech_seconds:.1f} s)"
    if not tracked:
        return "no face was found"
    if media.mouth_seconds < MIN_MOUTH_SECONDS:
        return f"a mouth is seen for {media.mouth_seconds:.1f} s only"
    return None


def judge(
    best: Estimate,
    offset_ms: float,
    motion: Motion | None,
    reference: float | None,
    typical: float = TYPICAL_CONFIDENCE,
) -> tuple[Verdict, str]:
    """Verdict and reason of a video that can be judged.

    Passes with an offset of at most one frame (or 40 ms, where frames are shorter) and at least
    60 % of the source's confidence, or of `CLEAREST_CONFIDENCE` where the source has more. Fails if
    the mouth does not move, the confidence is below 30 % of the source's, or the offset is visible.
    `reference` is the source's confidence; `typical` replaces it without a source.
    """
    whose = "the source's" if reference is not None else "real speakers'"
    share = best.confidence / max(reference if reference is not None else typical, 1e-6)
    if motion is not None and not motion.moves:
        return "fail", f"the mouth hardly moves (opening range {motion.opening_range:.3f})"
    if share < FAIL_SHARE:
        words = "the mouth moves, but does not follow these words"
        return "fail", f"{words}: {share:.0%} of {whose} certainty"
    side = "early" if best.offset > 0 else "late"
    off = f"audio {side} by {abs(best.offset)} frames ({abs(offset_ms):.0f} ms)"
    if abs(best.offset) > 1 and abs(offset_ms) > FAIL_MS:
        return "fail", off
    if abs(best.offset) > 1 and abs(offset_ms) > TOLERANCE_MS:
        return "warn", off
    if share < PASS_SHARE and (reference or 0.0) > CLEAREST_CONFIDENCE:
        share = best.confidence / CLEAREST_CONFIDENCE
        whose = "a clear unknown speaker's"
    enough = f"{share:.0%} of {whose} certainty ({PASS_SHARE:.0%} is enough)"
    if share < PASS_SHARE:
        return "warn", f"the mouth follows the sound loosely, look at it: {enough}"
    return "pass", f"the mouth follows the sound, offset {best.offset} frames: {enough}"


def judge_part(
    best: Estimate | None, rate: float, seconds: float, voice: float, reference: float | None
) -> tuple[Verdict, str]:
    """Verdict and reason of a part of a video, by itself.

    Args:
        best: None for lack of frames.
        rate: frames a second.
        voice: share of speech.
        reference: the source's confidence, if known.
    """
    if seconds < MIN_SECONDS:
        return "unjudged", f"only {seconds:.1f} s long, {MIN_SECONDS:.0f} s are needed"
    if voice * seconds < MIN_SPEECH_SECONDS:
        return "unjudged", f"no speech in the sound ({voice * seconds:.1f} s)"
    if best is None:
        return "unjudged", "too little of a mouth and its sound to compare"
    return judge(best, best.offset * 1000 / rate, None, reference)


def conclude(
    measured: Measurement | None,
    method: str,
    media: Media,
    source: SyncResult | None,
    *,
    tracked: bool,
    typical: float = TYPICAL_CONFIDENCE,
) -> SyncResult:
    """The result of a video with sound.

    Args:
        measured: None if there was too little to compare.
        tracked: whether any face was tracked.
        typical: the method's confidence that is used without a source.
    """
    reason = unjudgeable(media, tracked)
    if measured is None or reason is not None:
        reason = reason or "too little of a mouth and its sound to compare"
        return SyncResult("unjudged", reason, method, media, source=source)
    offset_ms = measured.best.offset * 1000 / measured.rate
    reference = reference_confidence(source, method)
    verdict, reason = judge(measured.best, offset_ms, measured.motion, reference, typical)
    return SyncResult(
        verdict,
        reason,
        method,
        media,
        offset_frames=measured.best.offset,
        offset_ms=offset_ms,
        confidence=measured.best.confidence,
        distance=measured.best.distance,
        curve=[float(d) for d in measured.curve],
        segments=measured.segments,
        speaking_face=measured.face,
        faces=measured.faces,
        motion=measured.motion,
        source=source,
    )
