"""The stage `draft`: a dub at half size, without marks of its own or checks, quickly."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.script.edit import Edit
from dubbing.stages.composite import OnFilm, PersonOnFilm, heads_of

if TYPE_CHECKING:
    import numpy as np

    from dfrf.method_interface import Maps
    from dfrf.model_interface import HeadModel
    from dubbing.identity.lip_scale import LipScale
    from dubbing.preparation.prepared import PreparedClip
    from dubbing.production.dub import Dub
    from dubbing.script.timeline import Cue
    from dubbing.sound_to_lips.cue_speech import Speech
    from dubbing.sound_to_lips.speech_frames import SpeechFrames
    from dubbing.video.heads import Heads


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
        cls, dub: Dub, speech: Mapping[str, Stage], people: Mapping[str, PersonOnFilm], device: str
    ) -> Self:
        """The stage for a dub."""
        return cls(
            **cls.common(dub, people),
            settings=replace(dub.settings, label=True, card=None, codec="h264", deliver="video"),
            speech=speech,
            edits={cue.name: cue.edit for cue in dub.cues},
            device=device,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.video.assembly import make

        film = self.opened()
        make(
            [film.heads(cue, self.edits[cue.name]) for cue in self.sound.cues],
            self.sound,
            out,
            pose_index=film.poses,
            settings=self.settings,
            progress=progress,
            proven=False,
        )

    def opened(self) -> HalfSize:
        """The film with its people, ready to be drafted with any edits."""
        from dubbing.preparation.halved import HalvedClip
        from dubbing.sound_to_lips.cue_speech import Speech

        films = {name: person.film() for name, person in self.people.items()}
        clips = {name: HalvedClip.of(film) for name, film in films.items()}
        return HalfSize(
            clips,
            {name: person.kept(films[name]) for name, person in self.people.items()},
            self.poses(clips),
            {name: Speech.load(stage.folder) for name, stage in self.speech.items()},
            self.people,
            self.device,
        )


@dataclass(frozen=True)
class HalfSize:
    """A film at half size, and the people in it.

    Attributes:
        clips, kept, people: by person: the film; why its frames keep their own face; the stages.
        poses: (F,) frame of the film under every frame of the dub.
        speech: by cue.
    """

    clips: Mapping[str, PreparedClip]
    kept: Mapping[str, np.ndarray]
    poses: np.ndarray
    speech: Mapping[str, Speech]
    people: Mapping[str, PersonOnFilm]
    device: str

    @cached_property
    def models(self) -> Mapping[str, tuple[HeadModel, Maps | None]]:
        """The model of each person, with its maps."""
        from dubbing.heads.rendering import load
        from dubbing.identity.learned import MODEL_FILE

        return {
            name: load(person.model.folder / MODEL_FILE, self.device)[:2]
            for name, person in self.people.items()
        }

    @cached_property
    def scales(self) -> Mapping[str, LipScale]:
        """The size of the lip measures of each person's model."""
        return {name: person.scale() for name, person in self.people.items()}

    def heads(self, cue: Cue, edit: Edit) -> Heads:
        """The heads of a cue, which are rendered as they are read."""
        return heads_of(cue, edit, self._rendered(cue, edit), self.clips, self.kept)

    def _rendered(self, cue: Cue, edit: Edit) -> Callable[[int, int], Iterator[np.ndarray]]:
        from dfrf.presets import method_of
        from dubbing.heads.frame_inputs import head_inputs
        from dubbing.heads.rendering import heads_of as rendered
        from dubbing.identity.lip_scale import given_lips

        model, maps = self.models[cue.identity]
        speech = self.speech[cue.name].styled(edit.style)
        frames = cue.stop - cue.first
        heard = edit.heard(frames, speech.rate)
        clip, poses = self.clips[cue.identity], self.poses[cue.first : cue.stop]
        strength = edit.strengths(frames, speech.rate)
        scale = partial(self.scales.__getitem__, cue.identity)
        lips = given_lips(edit, frames, speech.rate, scale)
        segment = method_of(model).segment

        def read(first: int, count: int) -> Iterator[np.ndarray]:
            for begin in range(first, first + count, segment):
                stop = min(begin + segment, first + count)
                inputs = head_inputs(
                    model,
                    clip,
                    lambda low, some: speech.at(heard[low : low + some]),
                    poses,
                    begin,
                    stop,
                    baked=True,
                    strength=strength,
                    lips=lips,
                    scale=scale,
                )
                yield from rendered(model, maps, inputs, clip, poses[begin:stop])

        return read

    def lips(self, cue: Cue, edit: Edit, strength: np.ndarray | None = None) -> np.ndarray | None:
        """Lengths (F, L) of the lips in the frames of a cue, in eye distances; None without lips.

        As heard, or as the curves of the edit give them; of the edit only its style counts, too.
        """
        from dubbing.heads.frame_inputs import wanted_lips

        name = cue.identity
        heard, given = self._heard(cue, edit)
        found = wanted_lips(self.models[name][0], heard, strength, given)
        return None if found is None else self.scales[name].lengths(found)

    def curves(self, cue: Cue, edit: Edit) -> np.ndarray | None:
        """The same (F, L) but for closures, and in a last column how far they are closed, 0..1."""
        import numpy as np

        from dubbing.heads.frame_inputs import parted_lips

        name = cue.identity
        found = parted_lips(self.models[name][0], *self._heard(cue, edit))
        if found is None:
            return None
        return np.c_[self.scales[name].lengths(found[:, :-1]), found[:, -1:]]

    def _heard(self, cue: Cue, edit: Edit) -> tuple[SpeechFrames, np.ndarray | None]:
        """Speech in the frames of a cue in the style of an edit, and the lips that it gives."""
        from dubbing.identity.lip_scale import given_lips

        speech = self.speech[cue.name].styled(edit.style)
        frames = min(cue.stop, len(self.poses)) - cue.first
        plain = Edit(curves=edit.curves)
        given = given_lips(plain, frames, speech.rate, lambda: self.scales[cue.identity])
        return speech.at(plain.heard(frames, speech.rate)), given
