"""The result of a sync check."""

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from dubbing.sync.curves import OFFSETS

Verdict = Literal["pass", "warn", "fail", "unjudged"]


def in_words(offset: int, offset_ms: float) -> str:
    """An offset that is not 0, as "audio early by 2 frames (80 ms)"."""
    side = "early" if offset > 0 else "late"
    plural = "s" if abs(offset) > 1 else ""
    return f"audio {side} by {abs(offset)} frame{plural} ({abs(offset_ms):.0f} ms)"


@dataclass(frozen=True)
class Segment:
    """Five seconds of the video, or one of the requested parts.

    Offset and confidence are None for lack of frames; see `judgement.judge_part`.
    """

    start: float
    end: float
    offset_frames: int | None
    confidence: float | None
    distance: float | None
    voice: float  # share of speech
    verdict: Verdict = "unjudged"
    reason: str = ""
    closeness: float | None = None
    parts: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Figures:
    """Figures of a mouth in speech; see `dubbing.sync.mouth_figures`.

    Attributes:
        certainty: median minus minimum of the curve of distance, where the sound belongs.
        opening: correlation of the opening with the one that the sound asks for.
        closures: the same of nearly closed lips.
        spread: standard deviation of the opening in speech, eye distances.
        range, speed: of the mouth, in what the sound asks for.
        loudness: correlation of the opening with the loudness.
        sharpness: amplitude of fine detail over that of all edges.
        restless: share of silent frames in which the mouth moves; None without silence.
    """

    certainty: float
    opening: float
    closures: float
    spread: float
    range: float
    speed: float
    loudness: float
    sharpness: float
    restless: float | None


@dataclass(frozen=True)
class FaceResult:
    """One face of the video: its position (shares of the frame), and how well it fits."""

    track: int
    column: float
    row: float
    seconds: float
    offset_frames: int | None
    confidence: float | None
    figures: Figures | None = None


@dataclass(frozen=True)
class Media:
    """Counts and lengths (seconds) of picture and sound."""

    frames: int
    rate: str
    picture_seconds: float
    sound_seconds: float
    speech_seconds: float
    mouth_seconds: float


@dataclass(frozen=True)
class SyncResult:
    """Lip sync of one video. Offsets count positive when the audio is early, as SyncNet does."""

    verdict: Verdict
    reason: str
    method: str
    media: Media
    offset_frames: int | None = None
    offset_ms: float | None = None
    confidence: float | None = None
    distance: float | None = None
    curve: list[float] = field(default_factory=list)  # mean distance at each of curve_offsets
    curve_offsets: list[int] = field(default_factory=lambda: list(OFFSETS))
    segments: list[Segment] = field(default_factory=list)
    speaking_face: int | None = None
    faces: list[FaceResult] = field(default_factory=list)
    closeness: float | None = None  # of a dub to its film, 0..1; see `dubbing.sync.closeness`
    parts: dict[str, float] = field(default_factory=dict)  # of the closeness
    source: "SyncResult | None" = None

    @property
    def words(self) -> str:
        """Offset in words: "audio early by 2 frames (80 ms)", "in sync" or "not measured".

        A mouth that does not follow the sound is not in sync, even without an offset: "no offset".
        """
        if self.offset_frames is None or self.offset_ms is None:
            return "not measured"
        if self.offset_frames == 0:
            return "no offset" if self.verdict == "fail" else "in sync"
        return in_words(self.offset_frames, self.offset_ms)

    def to_json(self) -> dict[str, Any]:
        """Plain values, ready for json.dumps; `source` holds the same of the source clip."""
        values = asdict(self)
        values["words"] = self.words
        values["source"] = self.source.to_json() if self.source is not None else None
        return values
