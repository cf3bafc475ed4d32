"""Chooses the tracks to read: of sound the default one, or mono tracks that belong together."""

import re
from collections.abc import Sequence

import av

from dubbing.media.opening.opening import LAYOUTS

Kind = av.stream.Disposition
OTHER = (
    *(Kind.comment, Kind.hearing_impaired, Kind.visual_impaired, Kind.descriptions),
    *(Kind.clean_effects, Kind.karaoke, Kind.lyrics, Kind.dub),
)
OTHER_TITLE = re.compile(r"comment|descri|director|music|effect|m\s*&\s*e|isolated", re.IGNORECASE)
Track = av.audio.stream.AudioStream


def pictures(container: av.container.InputContainer) -> list[av.video.stream.VideoStream]:
    """The video tracks, of which the first is read; a picture of a cover is none."""
    return [s for s in container.streams.video if not s.disposition & Kind.attached_pic]


def heard_tracks(tracks: Sequence[Track]) -> list[Track]:
    """The tracks to read: one, or several mono tracks that are channels of one sound.

    The container's default flag decides. Where it marks several or none, the first that is not a
    commentary is taken. Post-production files store each channel in a track: mono tracks of one
    codec, rate and language are combined, at most eight, unless the flag distinguishes them. Some
    writers flag only the first track.
    """
    readable = [t for t in tracks if t.codec_context is not None]
    if not readable:
        return list(tracks[:1])  # reading it reports the error
    flagged = [t for t in readable if t.disposition & Kind.default] or readable
    first = next((t for t in flagged if not _is_other(t)), flagged[0])
    if first.channels != 1:
        return [first]
    group = [t for t in readable if _alike(t) == _alike(first) and not _is_other(t)] or [first]
    both = [t for t in group if t in flagged]
    if len(both) == 1:
        both = group if first is group[0] else [first]
    return both[: max(LAYOUTS)]


def _is_other(track: Track) -> bool:
    """Whether a track is a commentary, description, or another track than the main sound."""
    flagged = any(track.disposition & kind for kind in OTHER)
    names = " ".join(track.metadata.get(key, "") for key in ("title", "handler_name"))
    return flagged or OTHER_TITLE.search(names) is not None


def _alike(track: Track) -> tuple[object, ...]:
    """The properties that single channels of one sound share."""
    return (track.channels, track.rate, track.codec_context.name, track.language or "und")
