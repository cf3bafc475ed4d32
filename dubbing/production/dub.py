"""A dub of a production: a film, the new speech of its people, and how it is finished."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import LONGEST_NAME
from dubbing.errors import ExplainedError
from dubbing.media import SUFFIX, MediaInfo
from dubbing.mixing.sound import Sound
from dubbing.production.clip import Clip, PersonClip
from dubbing.production.person import Person
from dubbing.provenance.mark_key import Marking, marking
from dubbing.provenance.signer import Signer
from dubbing.script.timeline import Cue
from dubbing.video.settings import VideoSettings


@dataclass(frozen=True)
class Undubbed:
    """A line of a script that nobody dubs, in frames of the film, and why not."""

    number: int
    first: int
    stop: int
    speaker: str
    words: str
    why: str


@dataclass(frozen=True)
class Dub:
    """One result: a film with new speech. A dub of one recording has one cue.

    Attributes:
        people: whose faces it replaces, each once.
        film: under it.
        sound: the cues with their recordings, and the sound under them.
        length: frames, without a card of credits.
        first: frame of the film under its first frame.
        on_longer_audio: see `timeline.pose_index`.
        baked: whether heads are rendered off their baked density; see `dfrf.rendering.baked_frame`.
        undubbed: lines of the script in this film that nobody dubs.
        events: numbers of the clips of the timeline that it is meant for.
        settings: of its video, but for the invisible mark; see `marking`.
        marked: whether the invisible mark is drawn; mark_key: a file with a key of the user's own.
        signer: of content credentials.
        fixed_edits: whether the manifest holds its edits, so that no file beside it may.
        blocked: why it cannot be made.
    """

    name: str
    people: tuple[Person, ...]
    film: Clip
    sound: Sound = field(default_factory=Sound)
    length: int = 0
    first: int = 0
    on_longer_audio: str = "bounce"
    baked: bool = True
    undubbed: tuple[Undubbed, ...] = ()
    events: tuple[int, ...] = ()
    settings: VideoSettings = field(default_factory=VideoSettings)
    marked: bool = True
    mark_key: Path | None = None
    signer: Signer | None = None
    fixed_edits: bool = False
    blocked: ExplainedError | None = None

    @property
    def cues(self) -> tuple[Cue, ...]:
        """In the order of their times."""
        return self.sound.cues

    @property
    def length_of_take(self) -> bool:
        """Whether its length, and so the name of its cue, is that of the take that is chosen."""
        takes = (take.audio for cue in self.cues for _, take in cue.edit.takes)
        return not self.sound.film_heard and any(takes)

    def person(self, cue: Cue) -> Person:
        """Who speaks a cue."""
        return next(person for person in self.people if person.name == cue.identity)

    def film_of(self, person: Person) -> PersonClip:
        """The film as it is prepared for a person: the part with their cues, if it is long."""
        whole = person.clip_at(self.film.path)
        cues = [cue for cue in self.cues if cue.identity == person.name]
        if not cues or self.first + self.length > whole.frames:
            return person.named(whole)
        rate = float(whole.rate)
        first, stop = min(cue.first for cue in cues), max(cue.stop for cue in cues)
        part = whole.part_with((self.first + first) / rate, (self.first + stop) / rate)
        return person.named(part)

    def timecode(self, frame: int) -> str:
        """Timecode of a frame of the dub, on the clock of the film."""
        return self.info.timecode_at(self.first + frame)

    @property
    def info(self) -> MediaInfo:
        """Facts of the film."""
        return self.film.probed

    def marking(self) -> Marking | None:
        """The invisible mark: its bits name the film and the sounds that it was made from."""
        if not self.marked or not self.cues:
            return None
        files = (self.film.path, *self.sound.files().values())
        return marking(self.mark_key, [digest_of(file) for file in files])

    def consent(self) -> Any:
        """Who agreed to it: the record of one person, or by name those of several."""
        given = {person.name: person.consent.record() for person in self.people}
        return given if len(given) > 1 else next(iter(given.values()))

    def signed_facts(self) -> dict[str, Any]:
        """The facts that signed credentials state, beside the models."""
        mark = self.marking()
        return {
            "consent": [person.consent.signed_record() for person in self.people],
            "audio": [digest_of(path) for path in self.sound.files().values()],
            "digests": "BLAKE2b-128",
            "mark": mark.id if mark else None,
        }

    def results(self) -> Mapping[str, str]:
        """Names of the files that it becomes, by kind."""
        return results_of(self.name, self.settings.codec)

    @property
    def draft(self) -> str:
        """Name of the file that its draft becomes."""
        return f"{self.name}.draft.mp4"

    def previous(self, name: str) -> str:
        """Name of an earlier result that is kept beside a new one."""
        return previous_of(self.name, name)


def results_of(name: str, codec: str) -> dict[str, str]:
    """Names of the files that a dub becomes, by kind: video, sync, proxy, lists of its lines."""
    found = {"video": f"{name}{SUFFIX[codec]}", "sync": f"{name}.sync.json"}
    if codec != "h264":
        found["proxy"] = f"{name}.proxy.mp4"
    return {**found, **{kind: f"{name}.{kind}" for kind in ("lines.csv", "lines.jsonl", "edl")}}


def previous_of(dub: str, name: str) -> str:
    """Name of the last result of a dub, kept beside the new one: `it.previous.mp4`."""
    suffix = f".previous{name.removeprefix(dub)}"
    room = LONGEST_NAME - len(suffix.encode())
    return dub.encode()[:room].decode(errors="ignore") + suffix
