"""A manifest's timeline with dubs on tracks above, as OTIO and as the file that it came from."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from dubbing.errors import ExplainedError
from dubbing.media.properties.frame_rate import snap
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.script.edl import Marker
from dubbing.script.timecode import frame_of, timecode_of
from dubbing.timelines import fcpxml
from dubbing.timelines.films import Films, Shot, shot_of
from dubbing.timelines.reading import ADAPTERS, Cut, Event, read

DROPPED = re.compile(r"\b\d\d:\d\d:\d\d;\d\d\b")
Markers = Callable[[Dub], Iterable[Marker]]


@dataclass(frozen=True)
class Laid:
    """An event, its frames, and the dub that holds them."""

    event: Event
    shot: Shot
    dub: Dub
    video: Path

    def clip(self, markers: Markers) -> Any:
        """The clip of OpenTimelineIO that lies over that of the event, on the dub's own clock."""
        import opentimelineio as otio

        film, dub, shot = self.shot.film, self.dub, self.shot
        rate = self.event.clip.trimmed_range().start_time.rate
        zero = film.first_frame if film.timecode else -dub.first

        def span(first: int, stop: int) -> Any:
            frames = (first + zero) / shot.unit, (stop - first) / shot.unit
            times = (otio.opentime.RationalTime(float(frame), rate) for frame in frames)
            return otio.opentime.TimeRange(*times)

        whole = span(dub.first, dub.first + dub.length)
        clip = otio.schema.Clip(
            self.video.name,
            media_reference=otio.schema.ExternalReference(self.video.as_uri(), whole),
            source_range=span(shot.first, shot.stop),
            metadata={"cmx_3600": {"reel": self.video.stem}},
        )
        for marker in markers(dub):
            first = max(shot.first, dub.first + marker.first)
            stop = min(shot.stop, dub.first + marker.stop)
            if first < stop:
                marked = otio.schema.Marker(marker.note, span(first, stop), marker.colour.upper())
                clip.markers.append(marked)
        return clip


def warnings(production: Production) -> list[str]:
    """The events of a manifest's timeline that no dub of it holds, in words.

    Raises:
        ExplainedError: the timeline cannot be read.
    """
    if production.timeline is None:
        return []
    cut, laid = _laid(production)
    left = [event for event in cut.events if event.number not in laid]
    name = production.timeline.name
    found = [f"{name}: no dub for {len(left)} of {len(cut.events)} events"] if left else []
    return found + [f"{name}: {event}: {event.why_not}" for event in left if event.why_not]


def files(production: Production, markers: Markers) -> dict[str, Callable[[Path], None]]:
    """Writers of a manifest's timeline with its dubs, by the names of the files.

    Args:
        markers: of a dub, in its frames.

    Raises:
        ExplainedError: the timeline cannot be read.
    """
    source = production.timeline
    assert source is not None  # the caller looked
    cut, found = _laid(production)
    import opentimelineio as otio  # it is there: the timeline was read

    laid = [one for one in found.values() if one.video.is_file()]
    clips = {id(one.event.clip): one.clip(markers) for one in laid}  # by that below
    kind = source.suffix.lower()
    text = source.read_text(encoding="utf-8-sig") if kind == ".fcpxml" else ""
    tracks = _tracks(cut, clips)
    for track, above in tracks:
        cut.timeline.tracks.insert(cut.timeline.tracks.index(track) + 1, above)

    def of_library(adapter: str) -> Callable[[Path], None]:
        keys = {"use_empty_mob_ids": True} if adapter == "AAF" else {}

        def write(path: Path) -> None:
            try:
                otio.adapters.write_to_file(cut.timeline, str(path), adapter, **keys)
            except Exception as error:  # adapters raise anything at what they cannot write
                why = " ".join(str(error).split())[:200]
                what = f"{adapter} cannot hold this timeline: {why}"
                raise ExplainedError(what, remedy="take the OTIO file") from error

        return write

    def list_of_edits(path: Path) -> None:
        path.write_text(edl(cut, [above for _, above in tracks]), encoding="utf-8")

    def final_cut(path: Path) -> None:
        below = [one.event.clip for one in laid]
        over = {clip.metadata[fcpxml.PLACE]: clips[id(clip)] for clip in below}
        path.write_text(fcpxml.laid_over(text, over), encoding="utf-8")

    own = {".edl": list_of_edits, ".fcpxml": final_cut}
    write = {kind: own.get(kind) or of_library(ADAPTERS[kind]), ".otio": of_library("otio_json")}
    return {f"{source.stem}.dubbed{suffix}": call for suffix, call in write.items()}


def _laid(production: Production) -> tuple[Cut, dict[int, Laid]]:
    """The timeline, and by the number of an event the dub that holds it."""
    assert production.timeline is not None
    dubs = [dub for dub in production.dubs.values() if dub.film.info is not None and dub.length]
    infos = {dub.film.path: dub.info for dub in dubs}
    films, meant = Films(infos, infos.__getitem__), [dub for dub in dubs if dub.events]
    cut = read(
        production.timeline,
        lambda text: [dub.info for dub in meant] if meant else films.named_in(text),
    )
    found = {}
    for event in (event for event in cut.events if not event.why_not):
        own = [dub for dub in meant if event.number in dub.events]
        try:
            shot = shot_of(own[0].info, event) if own else films.shot(event)
        except ValueError:
            continue  # of another film, which nobody dubs
        dub = next((dub for dub in own or dubs if _holds(dub, shot)), None)
        if dub is not None:
            video = production.output / dub.results()["video"]
            found[event.number] = Laid(event, shot, dub, video)
    return cut, found


def _holds(dub: Dub, shot: Shot) -> bool:
    first, stop = shot.shown
    same = dub.film.path == shot.film.path
    return same and dub.first <= first and stop <= dub.first + dub.length


def _tracks(cut: Cut, clips: dict[int, Any]) -> list[tuple[Any, Any]]:
    """The tracks with dubbed clips, each with the track of its dubs."""
    import opentimelineio as otio

    found = []
    for track in cut.timeline.video_tracks():
        above = otio.schema.Track(f"{track.name} dubbed", kind=track.kind)
        above.source_range = track.source_range
        items = list(track)
        there = [id(item) in clips for item in items]
        for k, item in enumerate(items):
            if isinstance(item, otio.schema.Transition):
                if there[k - 1 : k] == there[k + 1 : k + 2] == [True]:
                    above.append(item.deepcopy())
            elif there[k]:
                above.append(clips[id(item)])
            else:
                gap = otio.opentime.TimeRange(duration=item.trimmed_range().duration)
                above.append(otio.schema.Gap(source_range=gap))
        if any(there):
            found.append((track, above))
    return found


def edl(cut: Cut, tracks: list[Any]) -> str:
    """The dubs of the only track that has some as an EDL, which holds one."""
    import opentimelineio as otio

    if len(tracks) != 1:
        what = f"an EDL holds one track, and {len(tracks)} have dubs"
        raise ExplainedError(what, remedy="take the OTIO file")
    track = tracks[0].deepcopy()
    start = cut.timeline.global_start_time
    track.source_range = otio.opentime.TimeRange(-start, track.available_range().duration)
    timeline = otio.schema.Timeline(cut.timeline.name, tracks=[track])
    for clip in track.find_clips():  # locators count as the timeline does
        place = clip.transformed_time_range(clip.source_range, timeline.tracks).start_time
        for marker in clip.markers:
            at = marker.marked_range.start_time - clip.source_range.start_time + place
            marker.marked_range = otio.opentime.TimeRange(at, marker.marked_range.duration)
    text = otio.adapters.write_to_string(timeline, "cmx_3600", rate=start.rate, reelname_len=None)
    rate = snap(Fraction(start.rate))
    if not cut.drop:  # the adapter always drops frames, at rates at which that can be
        text = DROPPED.sub(lambda match: timecode_of(frame_of(match[0], rate), rate), text)
    title, _, rest = text.partition("\n")
    return f"{title}\nFCM: {'DROP FRAME' if cut.drop else 'NON-DROP FRAME'}\n{rest}"
