"""The sound of a dub: voices, and what lies under them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dubbing.script.timeline import Cue

# The voices alone, and all that is heard.
VOICES, SOUND = "voices.flac", "sound.flac"


@dataclass(frozen=True)
class Sound:
    """Voices over a bed; see `dubbing.mixing.mix`.

    Attributes:
        cues: in the order of their times, with their recordings.
        film_heard: whether the film's own sound is part of the bed.
        music: music and effects, the bed instead of the film's sound.
        left: frames (first, stop) in which people speak who are not dubbed.
        loudness: r128, streaming or none; see `dubbing.mixing.voices`.
    """

    cues: tuple[Cue, ...] = ()
    film_heard: bool = False
    music: Path | None = None
    left: tuple[tuple[int, int], ...] = ()
    loudness: str = "none"

    @property
    def recording(self) -> Cue | None:
        """The cue whose recording is all that is heard, unchanged; None where voices are mixed."""
        alone = len(self.cues) == 1 and not self.film_heard and self.music is None
        return self.cues[0] if alone and self.loudness == "none" else None

    def files(self) -> dict[str, Path]:
        """Its files, by their role."""
        found = {f"audio {cue.name}": cue.audio for cue in self.cues}
        return found if self.music is None else {**found, "music": self.music}
