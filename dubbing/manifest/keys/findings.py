"""Contents of the files that a manifest names, and mistakes in how they are used."""

from dataclasses import dataclass, field
from pathlib import Path

from dubbing.engine.disk.numbered import is_there, plain
from dubbing.errors import MediaError
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.media import MediaInfo, probe
from dubbing.production.dub import Undubbed
from dubbing.script.timeline import Cue


@dataclass(frozen=True)
class Scene:
    """The speech of a dub, when it is spoken, and the film under it.

    Attributes:
        clip: the film.
        cues: in the order of their times.
        length: frames of the dub.
        first: frame of the film under its first frame.
        on_longer_audio: see `timeline.pose_index`.
        film_heard: whether the film's own sound lies under the voices.
        left: frames (first, stop) in which people speak who are not dubbed.
        undubbed: the lines of these frames, and all others of the film that nobody dubs.
    """

    clip: Path
    cues: tuple[Cue, ...] = ()
    length: int = 0
    first: int = 0
    on_longer_audio: str = "cut"
    film_heard: bool = False
    left: tuple[tuple[int, int], ...] = ()
    undubbed: tuple[Undubbed, ...] = ()


@dataclass
class Findings:
    """Contents of the files, damaged files, and mistakes in how they are used.

    ``baseless``: what is wrong with learning people from a base, which not every command does.

    ``scenes``: by the place of the dub in the list, of those whose files are good; ``blocked``: a
    damaged file of the others. ``identities``: with the clip that each learns from. ``dubs``:
    places of those that were looked into.
    """

    media: dict[Path, MediaInfo] = field(default_factory=dict)
    damaged: dict[Path, MediaError] = field(default_factory=dict)
    problems: list[tuple[KeyPath, str]] = field(default_factory=list)
    baseless: list[tuple[KeyPath, str]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    scenes: dict[int, Scene] = field(default_factory=dict)
    identities: dict[str, Identity] = field(default_factory=dict)
    dubs: set[int] = field(default_factory=set)
    blocked: dict[int, MediaError] = field(default_factory=dict)

    def look(self, path: Path, key: KeyPath) -> MediaInfo | None:
        """Probe a file once. One that is missing is a problem; one that is damaged is kept."""
        if not is_there(path):
            others = "#" in path.name or "%0" in path.name
            kinds = "; an image sequence is EXR, DPX or TIFF" if others else ""
            self.add(key, f"no such file: {plain(path)}{kinds}")
            return None
        if path not in self.media and path not in self.damaged:
            try:
                self.media[path] = probe(path)
            except MediaError as error:
                self.damaged[path] = error
        if path in self.damaged and key[0] == "dubs":
            self.blocked.setdefault(int(key[1]), self.damaged[path])
        return self.media.get(path)

    def look_for_sound(self, path: Path, key: KeyPath) -> MediaInfo | None:
        """The same of a file that must have sound: one without is a problem, and None."""
        info = self.look(path, key)
        if info is not None and info.audio_rate is None:
            self.add(key, f"no sound in {path}")
            return None
        return info

    def add(self, key: KeyPath, message: str) -> None:
        """Add a problem at a key."""
        self.problems.append((key, message))

    def warn(self, warning: str) -> None:
        """Add a warning, once."""
        if warning not in self.warnings:
            self.warnings.append(warning)
