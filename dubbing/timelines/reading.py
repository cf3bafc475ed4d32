"""Reads a timeline: EDL (CMX3600), AAF and OTIO by OpenTimelineIO, FCPXML by `fcpxml`."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from dubbing import packages
from dubbing.engine.disk.files import read_text
from dubbing.errors import ExplainedError
from dubbing.media import MediaInfo
from dubbing.media.properties.frame_rate import snap
from dubbing.script.timecode import can_drop, timecode_of
from dubbing.timelines import edl, fcpxml

MOST_BYTES = 10**8
ADAPTERS = {".edl": "cmx_3600", ".fcpxml": "", ".aaf": "AAF", ".otio": "otio_json"}
NESTED = "it is a composition in itself: flatten it"
DROP = re.compile(r'<sequence\b[^<>]* tcFormat="DF"')  # clips have one of their own
RETIMED = "its speed is changed: write a film of it, and cut that in"


@dataclass(frozen=True)
class Event:
    """A clip on a timeline.

    Attributes:
        number: its place among the clips with picture, from 1.
        timecode: where it begins on the timeline.
        names: by which its film may be found, the surest first.
        rate: of its source times a second.
        first, stop: source times of the cut; shown: with the frames of its transitions.
        base: the source time of the film's first frame, if it says so.
        record: seconds from the start of the timeline to ``first``.
        notes: text of its markers.
        why_not: why it cannot be dubbed.
        clip: the object of OpenTimelineIO.
    """

    number: int
    timecode: str
    names: tuple[str, ...]
    rate: Fraction
    first: Fraction
    stop: Fraction
    shown: tuple[Fraction, Fraction]
    base: Fraction | None
    record: Fraction
    notes: tuple[str, ...]
    why_not: str
    clip: Any

    def __str__(self) -> str:
        return f"event {self.number:03d} at {self.timecode} ({self.names[0]})"


@dataclass(frozen=True)
class Cut:
    """A timeline, an object of OpenTimelineIO that says where it starts.

    Attributes:
        drop: whether its timecodes are drop-frame.
        events: its clips with picture, track by track.
    """

    timeline: Any
    drop: bool
    events: tuple[Event, ...]


def read(path: Path, films: Callable[[str], Iterable[MediaInfo]]) -> Cut:
    """The timeline of a file.

    Args:
        films: those that a text names. An EDL has no frame rate, and takes theirs.

    Raises:
        ExplainedError: it cannot be read, or its rate is not known.
    """
    packages.require("film")
    import opentimelineio as otio

    kind = path.suffix.lower()
    if kind not in ADAPTERS:
        known = ", ".join(ADAPTERS)
        raise ExplainedError(f"no kind of timeline: {kind!r}", path.name, f"one of {known}")
    try:
        text = "" if kind == ".aaf" else read_text(path, MOST_BYTES)
        named = list(films(text)) if kind == ".edl" else []
        rate = _rate_of_list(named) if kind == ".edl" else None
    except OSError as error:
        raise ExplainedError(f"cannot be read: {error.strerror}", path.name) from error
    except ExplainedError as error:
        raise ExplainedError(error.what, path.name, error.remedy) from error
    try:
        if kind == ".fcpxml":
            found: Any = fcpxml.read(text)
        elif kind == ".aaf":
            found = otio.adapters.read_from_file(str(path), ADAPTERS[kind])
        elif rate is not None:
            text = edl.plain(text, drops=any(film.drops for film in named))
            found = otio.adapters.read_from_string(text, "cmx_3600", rate=rate)
        else:
            found = otio.adapters.read_from_string(text, ADAPTERS[kind])
        several = found if isinstance(found, otio.schema.SerializableCollection) else [found]
        several = [one for one in several if isinstance(one, otio.schema.Timeline)]
        if len(several) != 1:
            raise ValueError(f"it holds {len(several)} timelines, not one")
        dropped = {".edl": edl.dropped(text), ".fcpxml": bool(DROP.search(text))}.get(kind)
        return cut_of(several[0], dropped=dropped)
    except Exception as error:  # adapters raise anything at what they cannot read
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise ExplainedError(f"it cannot be read as a timeline: {why}", path.name) from error


def cut_of(timeline: Any, *, dropped: bool | None = None) -> Cut:
    """The cut of an object of OpenTimelineIO.

    Args:
        dropped: whether its timecodes are drop-frame; None if its file does not say.
    """
    import opentimelineio as otio

    _start(timeline)
    can = can_drop(snap(Fraction(timeline.global_start_time.rate)))
    drop = can and dropped is not False
    found: list[Event] = []
    for track in timeline.video_tracks():
        markers = [*timeline.tracks.markers, *track.markers]
        for item in track:
            if not isinstance(item, otio.core.Item) or isinstance(item, otio.schema.Gap):
                continue
            media = getattr(item, "media_reference", None)
            seen = item.enabled and track.enabled
            if seen and not isinstance(media, otio.schema.GeneratorReference):
                found.append(_event(item, timeline, markers, len(found) + 1, drop))
    return Cut(timeline, drop, tuple(found))


def frames(time: Any) -> Fraction:
    """The value of a time of OpenTimelineIO."""
    return Fraction(time.value).limit_denominator(10**6)


def _event(item: Any, timeline: Any, markers: list[Any], number: int, drop: bool) -> Event:
    import opentimelineio as otio

    source, shown = item.trimmed_range(), item.visible_range()
    on_cut = item.transformed_time_range(source, timeline.tracks)
    rate = snap(Fraction(on_cut.start_time.rate))
    at = frames(on_cut.start_time)
    start = timeline.global_start_time
    clock = snap(Fraction(start.rate))
    own = [*item.markers, *(m for m in markers if on_cut.contains(m.marked_range.start_time))]
    nested = not isinstance(item, otio.schema.Clip)
    retimed = edl.changes_speed(item.metadata, source.start_time.rate) or any(
        isinstance(effect, otio.schema.TimeEffect) and getattr(effect, "time_scalar", 0) != 1
        for effect in item.effects
    )
    media = getattr(item, "media_reference", None)
    there = getattr(media, "available_range", None)
    return Event(
        number=number,
        timecode=timecode_of(round(frames(start) + at / rate * clock), clock, drop=drop),
        names=tuple(dict.fromkeys(filter(None, _names(item, media)))) or ("no name",),
        rate=snap(Fraction(source.start_time.rate)),
        first=frames(source.start_time),
        stop=frames(source.end_time_exclusive()),
        shown=(frames(shown.start_time), frames(shown.end_time_exclusive())),
        base=frames(there.start_time.rescaled_to(source.start_time.rate)) if there else None,
        record=at / rate,
        notes=tuple(filter(None, (f"{m.name} {m.comment}".strip() for m in own))),
        why_not=NESTED if nested else RETIMED if retimed else "",
        clip=item,
    )


def _names(item: Any, media: Any) -> Iterator[str]:
    """Names that its film may have: of the file that is named, of the clip, or of the reel."""
    url = getattr(media, "target_url", "") or ""
    yield PurePosixPath(unquote(url).replace("\\", "/")).name
    if hasattr(media, "name_prefix"):  # numbered files
        digits = "#" * max(1, media.frame_zero_padding)
        yield f"{media.name_prefix}{digits}{media.name_suffix}"
    yield item.name or ""
    yield (media and media.name) or ""
    yield str(item.metadata.get("cmx_3600", {}).get("reel", ""))


def _start(timeline: Any) -> None:
    """Let a timeline say where it starts. Of an EDL, its tracks do: they begin before zero."""
    import opentimelineio as otio

    zero = otio.opentime.RationalTime(0, timeline.duration().rate)
    begins = [
        -track.source_range.start_time if track.source_range else zero for track in timeline.tracks
    ]
    if timeline.global_start_time is None:
        timeline.global_start_time = max(zero, min(begins, default=zero))
    for track, begin in zip(timeline.tracks, begins, strict=True):
        if begin > zero:
            track.source_range = None
            late = otio.opentime.TimeRange(zero, begin - timeline.global_start_time)
            if late.duration > zero:
                track.insert(0, otio.schema.Gap(source_range=late))


def _rate_of_list(films: Iterable[MediaInfo]) -> float:
    """Timecodes a second of an EDL: those of the films that it names."""
    rates = {film.timecode_rate for film in films}
    if not rates:
        raise ExplainedError("an EDL has no frame rate, and no film is called as one in it")
    if len(rates) > 1:
        there = ", ".join(f"{float(rate):.6g}" for rate in sorted(rates))
        remedy = "write one EDL for each rate, or FCPXML, AAF or OTIO"
        raise ExplainedError(f"its films have {there} frames a second", remedy=remedy)
    return float(rates.pop())
