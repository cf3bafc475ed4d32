"""The cues of a scene: the frames of its lines, each with its sound, and the lines left out."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings
from dubbing.manifest.keys.messages import some
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.manifest.scenes.reels import REMEDY
from dubbing.media import MediaInfo
from dubbing.production.dub import Undubbed
from dubbing.script.line import Line
from dubbing.script.speakers import Names
from dubbing.script.timeline import Cue

CUE = re.compile(r"\{cue(?::0?([1-9]))?\}")  # {cue}, or {cue:03} with leading zeros

TAIL = 0.25  # seconds of a line that a track may lack: silence is trimmed off its end


class SceneCues:
    """The cues of one dub, and what is wrong with them."""

    def __init__(
        self, findings: Findings, at: KeyPath, dub: Dub, film: MediaInfo, *, reel: bool
    ) -> None:
        self.reel = reel
        self.findings, self.at, self.dub, self.film = findings, at, dub, film
        self.rate = film.rate
        self.cues: list[Cue] = []
        self.left: list[tuple[int, int]] = []
        self.undubbed: list[Undubbed] = []
        self.carried: list[str] = []
        self.too_long: list[str] = []
        self.unheard: list[str] = []
        self.cut_short: list[str] = []
        self.numbered: dict[int, Line] = {}
        self.twice: list[str] = []
        self.given = 0  # lines that somebody dubs, with or without a sound

    def add_all(self, lines: list[Line]) -> None:
        """Lines one after another, or what several people say in one cue."""
        people = [self._identity(line.speaker) for line in lines]
        if not lines[0].shared or len(set(people)) == 1:
            if lines[0].shared and people[0] is not None:
                words = " ".join(line.words for line in lines)
                lines = [replace(lines[0], words=words)]
            for line in lines:
                self.add(line)
            return
        apart = self._tracks_apart([line for line in lines if self._identity(line.speaker)])
        why = "several speak in its cue: give each a cue or a track of their own"
        for line in lines:
            self.add(line, "" if apart else why)

    def _tracks_apart(self, lines: list[Line]) -> bool:
        """Whether each speaker has a track beside the film, where the others are silent."""
        tracks = [self._named_sound(line) for line in lines]
        return (
            isinstance(self.dub.audio, dict)
            and len({*tracks}) == len(lines)
            and not any(CUE.search(str(track)) for track in tracks)
        )

    def add(self, line: Line, why_not: str = "") -> None:
        """The frames of a line, and the sound for them."""
        first, stop = (round(time * self.rate) for time in (line.start, line.stop))
        where = f"line {line.number} of {self.dub.lines and self.dub.lines.name}"
        if first < 0 or first >= self.film.frames or stop > self.film.frames + 1:
            if not self.reel:
                end = f"the film is {self.film.duration:.2f} s long; {REMEDY}"
                times = f"{float(line.start):g} to {float(line.stop):g} s"
                self.findings.add((*self.at, "lines"), f"{where} is at {times}: {end}")
                return
            why_not = "it reaches beyond the film"
        first, stop = max(0, first), min(stop, self.film.frames)
        if stop <= first:
            self.findings.add((*self.at, "lines"), f"{where} is shorter than a frame")
            return
        identity = self._identity(line.speaker)
        if identity is None or why_not:
            unknown = f"{line.speaker} is not in speakers" if line.speaker else "it names nobody"
            own = (line.number, first, stop, line.speaker, line.words)
            self.left.append((first, stop))
            self.undubbed.append(Undubbed(*own, why_not or unknown))
            return
        self.given += 1
        sound = self._sound(line, first, stop)
        if sound is not None:
            length = float((stop - first) / self.rate)
            who = (line.number, line.speaker, line.words)
            self.cues.append(Cue(identity, first, stop, sound[0], sound[1], length, *who))
            self.carried += [str(line.number)] if line.carried else []

    def _identity(self, speaker: str) -> str | None:
        if self.dub.speakers is None:
            return self.dub.identity
        return self.dub.speakers.get(speaker)

    def _named_sound(self, line: Line) -> Path | None:
        """The sound that the manifest has for a line's speaker; None where it has none."""
        if not isinstance(self.dub.audio, dict):
            return self.dub.audio
        return self.dub.audio.get(Names(self.dub.audio).known(line.speaker))

    def _sound(self, line: Line, first: int, stop: int) -> tuple[Path, float] | None:
        """The sound of a line, and where in it the line begins, seconds."""
        key = (*self.at, "audio")
        named = self._named_sound(line)
        if named is None:
            self.findings.add(key, f"has no sound of {line.speaker!r}")
            return None
        path = Path(CUE.sub(lambda m: str(line.number).zfill(int(m[1] or 1)), str(named)))
        if path != named and self.numbered.setdefault(line.number, line) is not line:
            self.twice.append(str(line.number))
        if (sound := self.findings.look_for_sound(path, key)) is None:
            return None
        if path == named:  # a track that runs beside the film
            start = float(first / self.rate)
            missing = float(stop / self.rate) - sound.sound_seconds
            if start >= sound.sound_seconds:
                self.unheard.append(f"{line.number} (at {start:.2f} s)")
            elif missing > TAIL:
                self.cut_short.append(f"{line.number} (by {missing:.2f} s)")
            return path, start
        there, room = sound.sound_seconds, float((stop - first + 1) / self.rate)
        if there > room:
            length = float((stop - first) / self.rate)
            self.too_long.append(f"{line.number} ({there:.2f} s in {length:.2f} s)")
        return path, 0.0

    def warn(self, count: int) -> None:
        """Say how many lines nobody dubs, and which were given to the speaker before them."""
        name = self.dub.lines and self.dub.lines.name
        said = []
        if self.undubbed:
            said.append(f"nobody dubs {len(self.undubbed)} of {count} lines of {name}")
        if self.too_long:
            said.append(f"lines {some(self.too_long)} are cut off with their cues")
        if self.cut_short:
            what = f"lines {some(self.cut_short)} last longer than the track of their sound"
            said.append(f"{what}: mouths stay shut after its end")
        if self.carried:
            what = f"lines {some(self.carried)} of {name} name nobody"
            said.append(f"{what}; they are taken for the speaker's before them")
        for warning in said:
            self.findings.warn(f"{self.dub.name}: {warning}")

    def check(self, lines: list[Line]) -> None:
        """Check all lines together: nobody's cues overlap, and everybody speaks."""
        speakers = {line.speaker for line in lines}
        there = ", ".join(sorted(speakers - {""})) or "nobody: it names no speakers"
        for name in self.dub.speakers or {}:
            if name not in speakers:
                message = f"does not speak in {self.dub.lines and self.dub.lines.name}; there is"
                self.findings.add((*self.at, "speakers", name), f"{message} {there}")
        if self.undubbed and not self.given:
            one = self.undubbed[0]
            message = f"it dubs none of {len(self.undubbed)} lines; line {one.number}: {one.why}"
            self.findings.add((*self.at, "lines"), message)
        for person in self.dub.people:
            own = sorted((c for c in self.cues if c.identity == person), key=lambda c: c.first)
            for cue, following in pairwise(own):
                if cue.first < following.first == cue.stop - 1:  # times were rounded somewhere
                    seconds = float((following.first - cue.first) / self.rate)
                    ended = replace(cue, stop=following.first, seconds=seconds)
                    self.cues[self.cues.index(cue)] = ended
                elif following.first < cue.stop:
                    both = f"lines {cue.number} and {following.number} of {person} overlap"
                    self.findings.add((*self.at, "lines"), f"{both}: nobody speaks two at a time")
        remedy = "lengthen the cues, shorten the recordings, or set on_longer_audio: cut"
        if self.dub.on_longer_audio != "cut":
            self._add_some(self.too_long, "last longer than their cues", remedy)
        self._add_some(self.twice, "are there twice", "number them anew: {cue} is the number")
        self._add_some(self.unheard, "begin after the end of their sound", "give a longer track")

    def _add_some(self, lines: list[str], what: str, remedy: str) -> None:
        if lines:
            self.findings.add((*self.at, "audio"), f"lines {some(lines)} {what}: {remedy}")
