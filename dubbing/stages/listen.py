"""The stage `listen`: speech features of a cue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate
from dubbing.stages.base import DubbingStage

if TYPE_CHECKING:
    from dubbing.production.person import Person
    from dubbing.script.timeline import Cue


@dataclass(frozen=True, kw_only=True)
class Listen(DubbingStage):
    """Makes speech features; see `dubbing.sound_to_lips.cue_speech`.

    Attributes:
        audio_start, seconds: of the recording.
        speech: name of the features; weights: their files, and those of the user's own
            `speech_weights`.
        rate: frames a second of the film.
    """

    audio: Path
    audio_start: float
    seconds: float
    speech: str
    rate: Fraction
    weights: Mapping[str, Path]
    speech_weights: Setting[Path | None]  # `weights` holds its files

    typical: ClassVar[Rate] = Rate(0.1, 18e3)

    @classmethod
    def of(cls, cue: Cue, person: Person, rate: Fraction) -> Self:
        """The stage for a cue of a person."""
        return cls(
            audio=cue.audio,
            audio_start=cue.audio_start,
            seconds=cue.seconds,
            speech=person.settings.speech,
            rate=rate,
            weights=person.speech_files,
            speech_weights=person.settings.weights,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.sound_to_lips.cue_speech import listen

        progress("listening", 0.0)
        listen(
            self.audio,
            out,
            name=self.speech,
            weights=self.speech_weights,
            rate=self.rate,
            start=self.audio_start,
            seconds=self.seconds,
        )

    def amount(self) -> float:
        return self.seconds
