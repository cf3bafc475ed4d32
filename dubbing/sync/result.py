"""The result of a sync check."""

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from dubbing.sync.curves import OFFSETS

Verdict = Literal["pass", "warn", "fail", "unjudged"]


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


@dataclass(frozen=True)
class FaceResult:
    """One face of the video: its position (shares of the frame), and how well it fits."""

    track: int
    column: float
    row: float
    seconds: float
    offset_frames: int | None
    confidence: float | None


@dataclass(frozen=True)
class Motion:
    """Mouth motion: range of the opening (5th to 95th percentile) in eye distances, speeds a s."""

    opening_range: float
    moves: bool
    moves_in_silence: bool | None  # None: too little silence to tell
    speed_in_speech: float | None
    speed_in_silence: float | None


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
    motion: Motion | None = None
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
        side = "early" if self.offset_frames > 0 else "late"
        count = abs(self.offset_frames)
        plural = "s" if count > 1 else ""
        return f"audio {side} by {count} frame{plural} ({abs(self.offset_ms):.0f} ms)"

    def to_json(self) -> dict[str, Any]:
        """Plain values, ready for json.dumps; `source` holds the same of the source clip."""
        values = asdict(self)
        values["words"] = self.words
        values["source"] = self.source.to_json() if self.source is not None else None
        return values
