"""Verdicts of the sync check, and their thresholds."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from dubbing.sync.closeness import Closeness
from dubbing.sync.curves import Estimate
from dubbing.sync.result import FaceResult, Figures, Media, Segment, SyncResult, Verdict, in_words

# A lip-sync error below 40 ms is not visible (ITU-R BT.1359: from 45 ms of sound that is early);
# at 25 fps this is one frame.
TOLERANCE_MS = 40.0
# The same finds sound 90 ms early no longer acceptable, and sound 125 ms late noticed.
FAIL_EARLY_MS, FAIL_LATE_MS = 90.0, 125.0
# Closeness of a dub to its film: what 3 s of a person have to the rest of them, and more seconds
# more (docs/development/sync.md).
PASS_MOST, PASS_SPREAD = 0.9, 0.27
FAIL_CLOSENESS = 0.5
FOLLOWS = 0.25  # `Closeness.follows` of a mouth that says these words
# Opening of a mouth that moves, standard deviation in eye distances; the least of 3 s of
# people was .0038, the most of a still one .0023.
MOVING_SPREAD = 0.0035
# Shares of the confidence of the source clip.
PASS_SHARE = 0.6
FAIL_SHARE = 0.3
# Used in place of the source's confidence without a source: 60 % of it is the 95th percentile of
# unrelated speech, on people left out of training (docs/development/sync.md).
TYPICAL_CONFIDENCE = 0.15
MIN_SECONDS = 3.0
MIN_SPEECH_SECONDS = 1.0
MIN_MOUTH_SECONDS = 2.0
# What is wrong where a part of the closeness lowers it most.
WRONG = {
    "timing": "The sound and the mouth are not quite together",
    "certainty": "The mouth follows the words loosely",
    "opening": "The mouth opens at other moments than the words ask for",
    "closures": "The lips do not close where the words ask for it",
    "range": "The mouth opens more or less than in the film",
    "speed": "The lips move faster or slower than in the film",
    "loudness": "The mouth follows the loudness more or less than in the film",
    "sharpness": "The mouth is softer or sharper than in the film",
    "silence": "The mouth moves while nobody speaks",
}


@dataclass(frozen=True)
class Measurement:
    """Measurement of the speaking face: estimate, curve over OFFSETS, frames a second.

    `film` is the face of the source that it is compared with, `near` how close it comes.
    """

    best: Estimate
    curve: Sequence[float]
    rate: float
    face: int
    figures: Figures | None = None
    film: FaceResult | None = None
    near: Closeness | None = None
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


def film_face(
    source: SyncResult | None, method: str, place: tuple[float, float]
) -> FaceResult | None:
    """The face of the source nearest to a place, if it follows its own sound for certain."""
    if source is None or source.method != method:
        return None
    column, row = place
    nearest = min(
        (face for face in source.faces if face.seconds >= MIN_SECONDS),
        key=lambda face: (face.column - column) ** 2 + (face.row - row) ** 2,
        default=None,
    )
    least = PASS_SHARE * TYPICAL_CONFIDENCE
    if nearest is None or nearest.figures is None or (nearest.confidence or 0) < least:
        return None
    return nearest


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
    figures: Figures | None,
    film: FaceResult | None = None,
    near: Closeness | None = None,
    *,
    seconds: float = MIN_SECONDS,
    typical: float = TYPICAL_CONFIDENCE,
) -> tuple[Verdict, str]:
    """Verdict and reason of so many seconds of a video that can be judged.

    Fails if the mouth hardly moves or does not follow the words, the offset is visible, or the
    closeness is low. Passes with an offset of at most one frame (or 40 ms, where frames are
    shorter), if it is as close to the film as that person's own seconds are; without a film, if it
    has 60 % of the `typical` confidence.
    """
    share = best.confidence / max((film and film.confidence) or typical, 1e-6)
    whose = "the film's" if film is not None else "real speakers'"
    sure = enough = f"{100 * share:.0f} % of {whose} certainty"
    follows, number, needed = 1.0, share, PASS_SHARE
    if near is not None:
        follows, number, needed = near.follows, near.number, pass_closeness(seconds)
        enough = f"{100 * number:.0f} % of the original"
    moves = figures is None or figures.spread >= MOVING_SPREAD
    off = out_of_sync(best.offset, offset_ms)
    # Words that are late are these words still.
    follows = follows if not off or share < PASS_SHARE else 1.0
    stranger = f"The mouth moves, but does not follow these words: {sure}"
    apart = f"Out of sync, {in_words(best.offset, offset_ms)}: {enough}"
    wrong = WRONG[near.weakest if near is not None else "certainty"]
    findings: tuple[tuple[bool, Verdict, str], ...] = (
        (not moves, "fail", "The mouth hardly moves"),
        (share < FAIL_SHARE, "fail", stranger),
        (off == "fail", "fail", apart),
        (follows < FOLLOWS, "fail", stranger),
        (near is not None and number < FAIL_CLOSENESS, "fail", f"{wrong}: {enough}"),
        (off == "warn", "warn", apart),
        (number < needed, "warn", f"{wrong}, look at it: {enough}"),
        (True, "pass", f"In sync. The mouth follows the words: {enough}"),
    )
    return next((verdict, f"{words}.") for holds, verdict, words in findings if holds)


def pass_closeness(seconds: float) -> float:
    """The closeness that so many seconds must have to pass."""
    return min(PASS_MOST, 1 - PASS_SPREAD * max(seconds, MIN_SECONDS) ** -0.5)


def out_of_sync(offset: int, offset_ms: float) -> Verdict | None:
    """Verdict on an offset in frames and ms, positive where the audio is early; None: in sync."""
    if abs(offset) <= 1 or abs(offset_ms) <= TOLERANCE_MS:
        return None
    return "fail" if not -FAIL_LATE_MS <= offset_ms <= FAIL_EARLY_MS else "warn"


def judge_part(
    best: Estimate | None,
    rate: float,
    seconds: float,
    voice: float,
    film: FaceResult | None,
    near: Closeness | None,
) -> tuple[Verdict, str]:
    """Verdict and reason of a part of a video, by itself; see `judge`.

    Args:
        best: None for lack of frames.
        rate: frames a second.
        voice: share of speech.
    """
    if seconds < MIN_SECONDS:
        return "unjudged", f"only {seconds:.1f} s long, {MIN_SECONDS:.0f} s are needed"
    if voice * seconds < MIN_SPEECH_SECONDS:
        return "unjudged", f"no speech in the sound ({voice * seconds:.1f} s)"
    if best is None:
        return "unjudged", "too little of a mouth and its sound to compare"
    return judge(best, best.offset * 1000 / rate, None, film, near, seconds=seconds)


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
    offset_ms, near = measured.best.offset * 1000 / measured.rate, measured.near
    verdict, reason = judge(
        measured.best,
        offset_ms,
        measured.figures,
        measured.film,
        near,
        seconds=media.picture_seconds,
        typical=typical,
    )
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
        closeness=near.number if near else None,
        parts=near.parts if near else {},
        source=source,
    )
