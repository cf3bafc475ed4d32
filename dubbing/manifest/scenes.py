"""The lines of a script as frames of a film, each with its sound.

A dub without lines is a scene of one speaker, whose one cue is the whole audio.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from dubbing.errors import DubbingError
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.findings import Findings, Scene
from dubbing.manifest.yaml_lines import KeyPath
from dubbing.media import MediaInfo
from dubbing.script import timeline
from dubbing.script.line import Line
from dubbing.script.reading import read_lines
from dubbing.script.timeline import Cue

CUE = re.compile(r"\{cue(?::0?([1-9]))?\}")  # {cue}, or {cue:03} with leading zeros
MOST_NAMED = 5  # lines that one sentence names
# Keys that only lines give a meaning, and those that they take it from.
OF_SCENES = ("speakers", "music_effects")
OF_ONE_SOUND = ("audio_start", "audio_seconds", "video_start")


def inspect_scene(
    findings: Findings, place: int, dub: Dub, identities: Mapping[str, Identity]
) -> None:
    """Check a dub that has lines; where all is well it becomes one of ``findings.scenes``."""
    at: KeyPath = ("dubs", place)
    before = len(findings.problems)
    _keys(findings, at, dub)
    assert dub.lines is not None
    film = film_of(findings, at, dub, identities)
    if not dub.lines.is_file():
        findings.add((*at, "lines"), f"no such file: {dub.lines}")
        return
    if film is None or film.picture is None:
        return
    try:
        lines = _from_start(findings, dub, film, read_lines(dub.lines, film.rate, film.first_frame))
    except DubbingError as error:
        findings.add((*at, "lines"), str(error))
        return
    scene = _Scene(findings, at, dub, film)
    for line in lines:
        scene.add(line)
    scene.check(lines)
    if len(findings.problems) == before and place not in findings.blocked:
        cues = tuple(sorted(scene.cues, key=lambda cue: cue.first))
        findings.scenes[place] = Scene(film.path, cues, tuple(scene.left))


def film_of(
    findings: Findings, at: KeyPath, dub: Dub, identities: Mapping[str, Identity]
) -> MediaInfo | None:
    """The film of a dub, which is a clip of everybody in it; None where that is not known."""
    people = {name: identities[name] for name in dub.people if name in identities}
    for name, identity in people.items():
        if dub.clip is None and len(identity.films) > 1:
            findings.add((*at, "clip"), f"is required: {name} has {len(identity.films)} clips")
            return None
        if dub.clip is not None and dub.clip not in identity.films:
            findings.add((*at, "clip"), f"{dub.clip} is no clip of {name}")
            return None
    # Whoever learns from another clip is recognised by that clip.
    faceless = [
        name
        for name, identity in people.items()
        if not identity.face and (dub.clip or identity.clip) == identity.clip
    ]
    if len(people) > 1 and faceless:
        message = "several people in a film need `face`, or another clip to learn from"
        findings.add((*at, "speakers"), f"{' and '.join(faceless)}: {message}")
        return None
    clips = [dub.clip or identity.clip for identity in people.values()]
    if len({*clips}) > 1:
        findings.add((*at, "speakers"), f"{' and '.join(people)} are people of different clips")
        return None
    # Where somebody learns from the damaged clip, their own job reports it.
    learned = {identity.clip for identity in people.values()}
    if clips and clips[0] in findings.damaged and clips[0] not in learned:
        findings.blocked.setdefault(int(at[1]), findings.damaged[clips[0]])
    return findings.media.get(clips[0]) if clips else None


class _Scene:
    """The cues of one dub, and what is wrong with them."""

    def __init__(self, findings: Findings, at: KeyPath, dub: Dub, film: MediaInfo) -> None:
        self.findings, self.at, self.dub, self.film = findings, at, dub, film
        self.rate = film.rate
        self.cues: list[Cue] = []
        self.left: list[tuple[int, int]] = []
        self.too_long: list[str] = []
        self.unheard: list[str] = []

    def add(self, line: Line) -> None:
        """The frames of a line, and the sound for them."""
        first, stop = (round(time * self.rate) for time in (line.start, line.stop))
        where = f"line {line.number} of {self.dub.lines and self.dub.lines.name}"
        if first >= self.film.frames or stop > self.film.frames + 1:
            end = f"the film is {self.film.duration:.2f} s long"
            times = f"{float(line.start):g} to {float(line.stop):g} s"
            self.findings.add((*self.at, "lines"), f"{where} is at {times}: {end}")
            return
        stop = min(stop, self.film.frames)
        if stop <= first:
            self.findings.add((*self.at, "lines"), f"{where} is shorter than a frame")
            return
        identity = self._identity(line.speaker)
        if identity is None:
            self.left.append((first, stop))
            return
        sound = self._sound(line, first, stop)
        if sound is not None:
            length = float((stop - first) / self.rate)
            who = (line.number, line.speaker, line.words)
            self.cues.append(Cue(identity, first, stop, sound[0], sound[1], length, *who))

    def _identity(self, speaker: str) -> str | None:
        if self.dub.speakers is None:
            return self.dub.identity
        return self.dub.speakers.get(speaker)

    def _sound(self, line: Line, first: int, stop: int) -> tuple[Path, float] | None:
        """The sound of a line, and where in it the line begins, seconds."""
        named, key = self.dub.audio, (*self.at, "audio")
        if isinstance(named, dict):
            if line.speaker not in named:
                self.findings.add(key, f"has no sound of {line.speaker!r}")
                return None
            named = named[line.speaker]
        path = Path(CUE.sub(lambda m: str(line.number).zfill(int(m[1] or 1)), str(named)))
        sound = self.findings.look(path, key)
        if sound is None or sound.audio_rate is None:
            if sound is not None:
                self.findings.add(key, f"no sound in {path}")
            return None
        if path == named:  # a track that runs beside the film
            start = float(first / self.rate)
            if start >= sound.sound_seconds:
                self.unheard.append(f"{line.number} (at {start:.2f} s)")
            return path, start
        there, room = sound.sound_seconds, float((stop - first + 1) / self.rate)
        if there > room and self.dub.on_longer_audio != "cut":
            length = float((stop - first) / self.rate)
            self.too_long.append(f"{line.number} ({there:.2f} s in {length:.2f} s)")
        return path, 0.0

    def check(self, lines: list[Line]) -> None:
        """Check all lines together: nobody's cues overlap, and everybody speaks."""
        speakers = {line.speaker for line in lines}
        there = ", ".join(sorted(speakers - {""})) or "nobody: it names no speakers"
        for name in self.dub.speakers or {}:
            if name not in speakers:
                message = f"does not speak in {self.dub.lines and self.dub.lines.name}; there is"
                self.findings.add((*self.at, "speakers", name), f"{message} {there}")
        for person in self.dub.people:
            own = sorted((c for c in self.cues if c.identity == person), key=lambda c: c.first)
            for cue, following in pairwise(own):
                if following.first < cue.stop:
                    both = f"lines {cue.number} and {following.number} of {person} overlap"
                    self.findings.add((*self.at, "lines"), f"{both}: nobody speaks two at a time")
        remedy = "lengthen the cues, shorten the recordings, or set on_longer_audio: cut"
        self._add_some(self.too_long, "last longer than their cues", remedy)
        self._add_some(self.unheard, "begin after the end of their sound", "give a longer track")

    def _add_some(self, lines: list[str], what: str, remedy: str) -> None:
        if lines:
            more = f" and {len(lines) - MOST_NAMED} more" if len(lines) > MOST_NAMED else ""
            named = ", ".join(lines[:MOST_NAMED]) + more
            self.findings.add((*self.at, "audio"), f"lines {named} {what}: {remedy}")


def _keys(findings: Findings, at: KeyPath, dub: Dub) -> None:
    """Keys that have no meaning together."""
    if dub.identity is not None and dub.speakers is not None:
        message = "name either who speaks all lines, or the identity of each speaker under speakers"
        findings.add((*at, "identity"), message)
    for key in OF_ONE_SOUND:
        if key in dub.model_fields_set and getattr(dub, key):
            findings.add((*at, key), "has no meaning beside lines, which have their own times")
    if dub.on_longer_audio in ("loop", "hold"):
        message = "a scene is as long as its film: cut or fail beside lines"
        findings.add((*at, "on_longer_audio"), message)
    if dub.frame != "full":
        findings.add((*at, "frame"), "a scene is its whole film: full beside lines")
    if dub.audio_rate == "source":
        findings.add((*at, "audio_rate"), "the sound of a scene is mixed at 48000")


def without_lines(findings: Findings, at: KeyPath, dub: Dub) -> bool:
    """Check that a dub without lines has no key that needs them."""
    before = len(findings.problems)
    for key in OF_SCENES:
        if getattr(dub, key) is not None:
            findings.add((*at, key), "needs lines, which name who speaks when")
    if dub.loudness != "none":
        findings.add((*at, "loudness"), "needs lines, whose sound is mixed")
    if isinstance(dub.audio, dict) or CUE.search(str(dub.audio)):
        findings.add((*at, "audio"), "several sounds need lines, which name who speaks when")
    return len(findings.problems) == before


def whole_audio(dub: Dub, film: MediaInfo, sound: MediaInfo) -> Scene:
    """The scene of one speaker whose one cue is the whole audio."""
    assert dub.identity is not None
    left = sound.sound_seconds - dub.audio_start
    seconds = min(left, dub.audio_seconds) if dub.audio_seconds else left
    frames = timeline.frame_count(seconds, film.rate)
    cue = Cue(dub.identity, 0, frames, sound.path, dub.audio_start, seconds)
    return Scene(film.path, (cue,))


def _from_start(findings: Findings, dub: Dub, film: MediaInfo, lines: list[Line]) -> list[Line]:
    """Lines whose times count from the film's first frame; scripts may use its timecode."""
    earliest = min(line.start for line in lines)
    offset = film.first_frame / film.rate
    # At 24000/1001 a second a clock may count the timecode's seconds or real ones: nobody knows.
    if film.rate.denominator > 1 or earliest < film.duration or earliest < offset:
        return lines
    name = dub.lines.name if dub.lines else ""
    findings.warnings.append(f"{dub.name}: times of {name} count from {film.timecode}")
    return [replace(line, start=line.start - offset, stop=line.stop - offset) for line in lines]
