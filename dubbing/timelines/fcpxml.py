"""Final Cut's XML: times are exact fractions of a second, and a film lies above another in a lane.

OpenTimelineIO's adapter cuts frame rates to whole numbers.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from dubbing.media.properties.frame_rate import snap

PLACE = "fcpxml"  # of a clip's element in the document, in the clip's metadata
CLIPS = ("asset-clip", "clip", "video", "ref-clip", "sync-clip", "mc-clip")
# What follows the clips in lanes, inside of a clip.
AFTER_LANES = {
    *("marker", "chapter-marker", "rating", "keyword", "analysis-marker", "metadata"),
    *("audio-channel-source", "audio-role-source", "filter-video", "filter-audio"),
}


@dataclass(frozen=True)
class _Placed:
    """An element of a clip, its lane, and where it begins on the timeline, in seconds."""

    element: Element
    lane: int
    at: Fraction


def read(text: str) -> Any:
    """The timeline in a document, an object of OpenTimelineIO.

    Raises:
        ValueError: there is not exactly one.
    """
    import opentimelineio as otio

    root, sequence, resources = _parse(text)
    rate = _rate(resources[sequence.get("format", "")])
    timeline = otio.schema.Timeline(next(root.iter("project")).get("name", ""))
    zero = _seconds(sequence.get("tcStart"))
    spine = sequence.find("spine")
    placed = [] if spine is None else list(_spine(spine, 0, -zero, resources))
    timeline.global_start_time = _otio_time(zero, rate)
    places = {id(element): place for place, element in enumerate(root.iter())}
    joins = [
        (_seconds(one.get("offset")) - zero, _seconds(one.get("duration")))
        for one in sequence.findall("spine/transition")
    ]
    for lane in sorted({one.lane for one in placed}):
        track = otio.schema.Track(f"V{lane}" if lane else "V", kind="Video")
        end = Fraction(0)
        for one in sorted((p for p in placed if p.lane == lane), key=lambda p: p.at):
            item = _item(one.element, resources, rate)
            if item is None:
                continue
            item.metadata[PLACE] = places[id(one.element)]
            if one.at > end:
                gap = _otio_range(Fraction(0), one.at - end, rate)
                track.append(otio.schema.Gap(source_range=gap))
            for at, length in joins if lane == 0 and len(track) else ():
                if at < one.at < at + length:
                    sides = (_otio_time(t, rate) for t in (one.at - at, at + length - one.at))
                    track.append(otio.schema.Transition("", "SMPTE_Dissolve", *sides))
            track.append(item)
            end = one.at + _seconds(one.element.get("duration"))
        timeline.tracks.append(track)
    return timeline


def laid_over(text: str, above: Mapping[int, Any]) -> str:
    """A document with clips of OpenTimelineIO in a lane above its own, by the places of these.

    All else stays as it was.
    """
    root, _, resources = _parse(text)
    elements = list(root.iter())
    top = 1 + max(int(element.get("lane", 0)) for element in elements)
    shelf = next(element for element in elements if element.tag == "resources")
    assets: dict[str, str] = {}
    for place, clip in above.items():
        under, media = elements[place], clip.media_reference
        of, name = _asset(under, resources), assets.get(media.target_url)
        if name is None:
            name = assets[media.target_url] = f"dub{len(assets) + 1}"
            keys = {"id": name, "name": clip.name, "src": media.target_url, "hasVideo": "1"}
            keys |= {"format": of[0].get("format", "")} if of else {}
            ElementTree.SubElement(shelf, "asset", keys | _written(media.available_range))
        keys = {"ref": name, "name": clip.name, "lane": str(top), "srcEnable": "video"}
        keys |= {"offset": f"{_start(under, resources)}s", **_written(clip.source_range)}
        over = Element("asset-clip", keys)
        for marker in clip.markers:
            keys = {"value": marker.name, **_written(marker.marked_range)}
            ElementTree.SubElement(over, "marker", keys)
        inside = [child.tag for child in under]
        after = (k for k, tag in enumerate(inside) if tag in AFTER_LANES)
        under.insert(next(after, len(inside)), over)
    body = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!DOCTYPE fcpxml>\n{body}\n'


def _parse(text: str) -> tuple[Element, Element, dict[str, Element]]:
    """The document, its sequence, and its resources by their names."""
    if "<!ENTITY" in text:
        raise ValueError("it declares entities, which are not read")
    root = ElementTree.fromstring(text)
    sequences, shelf = root.findall(".//project/sequence"), root.find("resources")
    if len(sequences) != 1 or shelf is None:
        raise ValueError(f"it holds {len(sequences)} projects; write one, with its resources")
    return root, sequences[0], {one.get("id", ""): one for one in shelf}


def _spine(
    spine: Element, lane: int, zero: Fraction, resources: dict[str, Element]
) -> Iterator[_Placed]:
    """Clips one after another, and those in lanes of theirs.

    ``zero``: where on the timeline their offsets count from.
    """
    end = Fraction(0)
    for child in spine:
        if child.tag == "transition":
            continue
        clip, offset = _picked(child), child.get("offset")
        at = end if offset is None else zero + _seconds(offset)
        yield from _clip(clip, lane, at, resources)
        end = at + _seconds(clip.get("duration"))


def _clip(
    element: Element, lane: int, at: Fraction, resources: dict[str, Element]
) -> Iterator[_Placed]:
    """A clip or a gap, and what lies in lanes above and below it."""
    if element.tag in CLIPS:
        yield _Placed(element, lane, at)
    zero = at - _start(element, resources)
    for child in element:
        if (own := int(child.get("lane", 0))) == 0:
            continue
        there = zero + _seconds(child.get("offset"))
        if child.tag == "spine":
            yield from _spine(child, lane + own, there, resources)
        else:
            yield from _clip(_picked(child), lane + own, there, resources)


def _picked(element: Element) -> Element:
    """Of an audition the clip that is shown, which is its first."""
    return element[0] if element.tag == "audition" and len(element) else element


def _item(element: Element, resources: dict[str, Element], rate: Fraction) -> Any:
    """A clip of OpenTimelineIO; a stack of a composition; None without picture, and of a still."""
    import opentimelineio as otio

    found, length = _asset(element, resources), _seconds(element.get("duration"))
    if found is None:
        whole = _otio_range(_seconds(element.get("start")), length, rate)
        nested = element.tag in ("ref-clip", "sync-clip", "mc-clip")
        return otio.schema.Stack(element.get("name", ""), source_range=whole) if nested else None
    asset, late = found
    form = resources.get(asset.get("format", ""))
    still = (
        form is not None and not form.get("frameDuration") and not _seconds(asset.get("duration"))
    )
    if asset.get("hasVideo", "1") == "0" or element.get("srcEnable") == "audio" or still:
        return None
    own = rate if form is None else _rate(form)
    original = asset.find("media-rep")
    url = asset.get("src") or (original.get("src", "") if original is not None else "")
    there = _otio_range(_seconds(asset.get("start")), _seconds(asset.get("duration")), own)
    clip = otio.schema.Clip(
        element.get("name", ""),
        media_reference=otio.schema.ExternalReference(url, there),
        source_range=_otio_range(_start(element, resources) + late, length, own),
    )
    clip.enabled = element.get("enabled", "1") != "0"
    conform = element.find("conform-rate")
    scaled = conform is not None and conform.get("scaleEnabled", "1") != "0"
    if element.find("timeMap") is not None or (scaled and round(own) != round(rate)):
        clip.effects.append(otio.schema.TimeEffect())
    notes = [(one.get("value", ""), one.get("start")) for one in element.findall("marker")]
    notes += [(one.text or "", element.get("start")) for one in element.findall("note")]
    for note, at in notes:
        marked = _otio_range(_seconds(at) + late, 1 / own, own)
        clip.markers.append(otio.schema.Marker(note, marked))
    return clip


def _asset(element: Element, resources: dict[str, Element]) -> tuple[Element, Fraction] | None:
    """The film of a clip, and by how much its times are later than the clip's own."""
    if element.tag == "clip":
        inner = next((one for one in element.findall("video") if not one.get("lane")), None)
        if inner is None or inner.get("ref") not in resources:
            return None
        late = _seconds(inner.get("start")) - _seconds(inner.get("offset"))
        return resources[inner.get("ref", "")], late
    asset = resources.get(element.get("ref", ""))
    return (asset, Fraction(0)) if asset is not None and asset.tag == "asset" else None


def _start(element: Element, resources: dict[str, Element]) -> Fraction:
    """Where a clip begins on its own clock: with its film, if it does not say."""
    asset = resources.get(element.get("ref", "")) if element.tag == "asset-clip" else None
    if element.get("start") is None and asset is not None:
        return _seconds(asset.get("start"))
    return _seconds(element.get("start"))


def _rate(of: Element) -> Fraction:
    length = _seconds(of.get("frameDuration"))
    if not length:
        raise ValueError(f"the format {of.get('id')} has no frame rate")
    return 1 / length


def _seconds(written: str | None) -> Fraction:
    return Fraction((written or "0").removesuffix("s"))


def _written(span: Any) -> dict[str, str]:
    """A range of OpenTimelineIO as attributes."""
    rate = snap(Fraction(span.start_time.rate))
    times = {"start": span.start_time, "duration": span.duration}
    return {key: f"{round(time.value) / rate}s" for key, time in times.items()}


def _otio_time(seconds: Fraction, rate: Fraction) -> Any:
    import opentimelineio as otio

    return otio.opentime.RationalTime(float(seconds * rate), float(rate))


def _otio_range(start: Fraction, length: Fraction, rate: Fraction) -> Any:
    import opentimelineio as otio

    return otio.opentime.TimeRange(_otio_time(start, rate), _otio_time(length, rate))
