"""Timelines for tests: cuts of films that are not there, and the productions of their dubs."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from dubbing.errors import MediaError
from dubbing.manifest.keys import yaml_lines
from dubbing.media import MediaInfo
from dubbing.media.properties.colour import Colour
from dubbing.media.properties.info import Picture
from dubbing.mixing.sound import Sound
from dubbing.production.clip import Clip
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.script.timecode import timecode_of
from dubbing.script.timeline import Cue, first_frame, frame_count
from dubbing.timelines import cut_manifest, stretch

otio: Any = pytest.importorskip("opentimelineio", reason="needs the extra film")

KINDS = ("edl", "fcpxml", "aaf", "otio")
RATES = {"23.976": Fraction(24000, 1001), "25": Fraction(25), "29.97": Fraction(30000, 1001)}
LENGTH = 400  # frames of a film
FILM_RATE = Fraction(25)


@dataclass(frozen=True)
class Piece:
    """Frames first .. stop of a film on the timeline, from a frame on; a note."""

    film: int
    first: int
    stop: int
    at: int
    note: str = ""


def hour(rate: Fraction) -> int:
    """The frame of 01:00:00:00; of 01:00:00;00, where frames may be dropped."""
    nominal = round(rate)
    return 107892 if nominal == 30 else nominal * 3600


def info_of(path: Path, rate: Fraction, *, timecode: bool = True) -> MediaInfo:
    """A film without a file: seven of them begin an hour and more into the day."""
    if path.suffix not in (".mov", ".mp4"):
        raise MediaError("no media", str(path))
    number = int(path.stem.removeprefix("shot"))
    start = timecode_of(start_of(number, rate), rate, drop=round(rate) == 30)
    sized = Picture(64, 48, Colour())
    seconds = float(LENGTH / rate)
    return MediaInfo(
        path, 64, 48, rate, LENGTH, seconds, False, 0.0, sized, 48000, 1, seconds, 0.0,
        timecode=start if timecode else "",
    )  # fmt: skip


def start_of(film: int, rate: Fraction) -> int:
    """The frame number of a film's first timecode."""
    return hour(rate) + 1000 * film


def pieces(count: int = 200, films: int = 7) -> list[Piece]:
    """A cut, with a gap after every twentieth clip."""
    chance, at, found = random.Random(1), 0, []
    for k in range(count):
        first, length = chance.randrange(10, 300), chance.randrange(10, 90)
        found.append(
            Piece(k % films, first, first + length, at, f"note {k}" if k % 50 == 0 else "")
        )
        at += length + (12 if k % 20 == 5 else 0)
    return found


def timeline(cut: Sequence[Piece], rate: Fraction) -> Any:
    """The cut as an object of OpenTimelineIO."""
    made = otio.schema.Timeline("cut")
    made.global_start_time = time(hour(rate), rate)
    track, end = otio.schema.Track("V1", kind="Video"), 0
    for piece in cut:
        if piece.at > end:
            track.append(otio.schema.Gap(source_range=span(0, piece.at - end, rate)))
        clip = otio.schema.Clip(f"shot{piece.film}")
        start = start_of(piece.film, rate)
        url = f"file:///elsewhere/shot{piece.film}.mov"
        there = span(start, start + LENGTH, rate)
        clip.media_reference = otio.schema.ExternalReference(url, there)
        clip.source_range = span(start + piece.first, start + piece.stop, rate)
        if piece.note:
            at = start + piece.first + 2
            clip.markers.append(otio.schema.Marker(piece.note, span(at, at + 1, rate), "GREEN"))
        track.append(clip)
        end = piece.at + piece.stop - piece.first
    made.tracks.append(track)
    return made


def time(frame: int, rate: Fraction) -> Any:
    return otio.opentime.RationalTime(frame, float(rate))


def span(first: int, stop: int, rate: Fraction) -> Any:
    return otio.opentime.TimeRange(time(first, rate), time(stop - first, rate))


def write(path: Path, cut: Sequence[Piece], rate: Fraction) -> Path:
    """The cut as a file, by its ending."""
    made = timeline(cut, rate)
    if path.suffix == ".fcpxml":
        path.write_text(fcpxml(cut, rate))
    elif path.suffix == ".edl":
        made.tracks[0].source_range = otio.opentime.TimeRange(
            -made.global_start_time, made.tracks[0].available_range().duration
        )
        text = otio.adapters.write_to_string(made, "cmx_3600", rate=float(rate), reelname_len=None)
        path.write_text(text)
    else:
        kind = {".aaf": {"use_empty_mob_ids": True}}.get(path.suffix, {})
        otio.adapters.write_to_file(made, str(path), **kind)
    return path


def fcpxml(cut: Sequence[Piece], rate: Fraction) -> str:
    """The cut as Final Cut writes it."""
    films = sorted({piece.film for piece in cut})
    clock = hour(rate)

    def seconds(frames: int) -> str:
        return f"{frames / rate}s"

    drop = "DF" if round(rate) == 30 else "NDF"
    rows = ['<?xml version="1.0" encoding="UTF-8"?>', "<!DOCTYPE fcpxml>", '<fcpxml version="1.9">']
    rows += [f'<resources><format id="r0" frameDuration="{1 / rate}s"/>']
    for film in films:
        place = f'start="{seconds(start_of(film, rate))}" duration="{seconds(LENGTH)}"'
        rows += [
            f'<asset id="a{film}" name="shot{film}" {place} hasVideo="1" format="r0">',
            f'<media-rep kind="original-media" src="file:///elsewhere/shot{film}.mov"/></asset>',
        ]
    rows += ['</resources><library><event name="e"><project name="cut">']
    rows += [f'<sequence format="r0" tcStart="{seconds(clock)}" tcFormat="{drop}"><spine>']
    end = 0
    for piece in cut:
        if piece.at > end:
            place = f'offset="{seconds(clock + end)}" duration="{seconds(piece.at - end)}"'
            rows += [f'<gap name="Gap" {place} start="3600s"/>']
        start = start_of(piece.film, rate) + piece.first
        length = piece.stop - piece.first
        rows += [
            f'<asset-clip ref="a{piece.film}" name="shot{piece.film}" start="{seconds(start)}"'
            f' offset="{seconds(clock + piece.at)}" duration="{seconds(length)}">'
        ]
        if piece.note:
            mark = f'start="{seconds(start + 2)}" duration="{seconds(1)}"'
            rows += [f'<marker {mark} value="{piece.note}"/>']
        rows += ["</asset-clip>"]
        end = piece.at + length
    return "\n".join([*rows, "</spine></sequence></project></event></library></fcpxml>", ""])


def dubbed(
    folder: Path, cut: Sequence[Piece], rate: Fraction, timeline: Path, *, timecode: bool = True
) -> Production:
    """The dubs of a cut, with handles of eight frames, whose videos are there."""
    dubs, out = {}, folder / "out"
    out.mkdir(exist_ok=True)
    for piece in cut:
        film = folder / f"shot{piece.film}.mov"
        info = info_of(film, rate, timecode=timecode)
        length = piece.stop - piece.first + 16
        cue = Cue("ann", 0, length, folder / "it.wav", 0.0, float(length / rate))
        name = f"shot{piece.film}_{piece.first}"
        dub = Dub(name, (), Clip(film, info), Sound((cue,)), length, piece.first - 8)
        dubs[dub.name] = dub
        (out / dub.results()["video"]).touch()
    return Production(folder / "m.yaml", out, {}, dubs, frozenset(dubs), timeline=timeline)


def use(monkeypatch: pytest.MonkeyPatch, rate: Fraction, *, timecode: bool = True) -> None:
    """Let films have a rate."""

    def probe(path: Path) -> MediaInfo:
        return info_of(path, rate, timecode=timecode)

    monkeypatch.setattr(cut_manifest, "probe", probe)
    monkeypatch.setattr(stretch, "probe", probe)


def written(folder: Path, cut: Path, handles: int = 0) -> tuple[list[dict[str, Any]], list[str]]:
    """The dubs that are written for a timeline, and what is said."""
    said: list[str] = []
    path = cut_manifest.write_manifest(folder, cut, handles, said.append)
    return yaml_lines.read(path.read_text()).data["dubs"], said


def frames(dub: dict[str, Any], rate: Fraction = FILM_RATE) -> tuple[int, int]:
    first = first_frame(dub["video_start"], rate)
    return first, first + frame_count(dub["audio_seconds"], rate)
