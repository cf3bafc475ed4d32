"""Settings of a dub's video, from the manifest to the encoder."""

from dataclasses import dataclass

from dubbing.provenance.card import CreditsCard
from dubbing.provenance.mark_key import Marking


@dataclass(frozen=True)
class VideoSettings:
    """Settings of a video.

    Attributes:
        frame: full, or crop for the head alone.
        label: whether the visible mark is drawn.
        card: of credits, after the last frame.
        mark: the invisible mark.
        codec: of `dubbing.media.CODECS`.
        deliver: frames beside the video: `turnover`, `sequence`, or none with `video`.
        audio_rate: Hz; None is that of the recording.
    """

    frame: str = "full"
    label: bool = True
    card: CreditsCard | None = None
    mark: Marking | None = None
    codec: str = "h264"
    deliver: str = "video"
    audio_rate: int | None = 48000
