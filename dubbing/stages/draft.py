"""The stage `draft`: a dub at half size, without marks of its own or checks, quickly."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.fields import Setting
from dubbing.engine.stage import Progress, Rate, Stage
from dubbing.script.timeline import Edit
from dubbing.stages.composite import OnFilm, PersonOnFilm, heads_of

if TYPE_CHECKING:
    import numpy as np

    from dubbing.preparation.prepared import PreparedClip
    from dubbing.production.dub import Dub
    from dubbing.script.timeline import Cue


@dataclass(frozen=True, kw_only=True)
class Draft(OnFilm):
    """Renders, composites and encodes in one go, a quarter of the pixels.

    It has the visible mark, and no invisible one. Heads are not kept.

    Attributes:
        speech: the stages that listen to the cues.
        edits: of the cues.
    """

    speech: Mapping[str, Stage]
    edits: Mapping[str, Edit]
    device: Setting[str]

    typical: ClassVar[Rate] = Rate(0.052, 1e3)

    @classmethod
    def of(
        cls,
        dub: Dub,
        speech: Mapping[str, Stage],
        people: Mapping[str, PersonOnFilm],
        device: str,
    ) -> Self:
        """The stage for a dub."""
        return cls(
            **cls.common(dub, people),
            settings=replace(dub.settings, label=True, card=None, codec="h264"),
            speech=speech,
            edits={cue.name: cue.edit for cue in dub.cues},
            device=device,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.preparation.halved import HalvedClip
        from dubbing.video.assembly import make

        films = {name: person.film() for name, person in self.people.items()}
        kept = {name: person.kept(films[name]) for name, person in self.people.items()}
        clips = {name: HalvedClip.of(film) for name, film in films.items()}
        poses = self.poses(clips)
        rendered = self._rendered(clips, poses)
        heads = [heads_of(cue, rendered(cue), clips, kept) for cue in self.sound.cues]
        make(
            heads,
            self.sound,
            out,
            pose_index=poses,
            settings=self.settings,
            progress=progress,
            proven=False,
        )

    def _rendered(
        self, clips: Mapping[str, PreparedClip], poses: np.ndarray
    ) -> Callable[[Cue], Callable[[int, int], Iterator[np.ndarray]]]:
        """What renders the heads of a cue as they are read."""
        from dfrf.presets import method_of
        from dubbing.heads import rendering
        from dubbing.heads.fine_tuning import MODEL_FILE
        from dubbing.sound_to_lips.cue_speech import Speech

        people = {
            name: rendering.load(person.model.folder / MODEL_FILE, self.device)
            for name, person in self.people.items()
        }

        def of_cue(cue: Cue) -> Callable[[int, int], Iterator[np.ndarray]]:
            model, maps, _ = people[cue.identity]
            edit, speech = self.edits[cue.name], Speech.load(self.speech[cue.name].folder)
            late = edit.shift / 1000 * float(speech.rate)  # frames
            strength = edit.strengths(cue.stop - cue.first, speech.rate)
            segment = method_of(model).segment

            def read(first: int, count: int) -> Iterator[np.ndarray]:
                for begin in range(first, first + count, segment):
                    yield from rendering.heads_of(
                        model,
                        maps,
                        clips[cue.identity],
                        lambda low, some: speech.part(low - late, some),
                        poses[cue.first : cue.stop],
                        begin,
                        min(begin + segment, first + count),
                        baked=True,
                        strength=strength,
                    )

            return read

        return of_cue
