"""The stage `composite`: heads onto the film, marks and sound: the finished video."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.mixing.sound import Sound
from dubbing.provenance.mark_key import Marking
from dubbing.script.edit import Edit
from dubbing.stages.base import DubbingStage, Prepared
from dubbing.video.settings import VideoSettings

if TYPE_CHECKING:
    import numpy as np

    from dubbing.identity.lip_scale import LipScale
    from dubbing.preparation.prepared import PreparedClip
    from dubbing.production.dub import Dub
    from dubbing.script.timeline import Cue
    from dubbing.video.heads import Heads


@dataclass(frozen=True)
class PersonOnFilm:
    """The stages of a person that a dub reads.

    Attributes:
        prepared: the film. poses: what the learned head says of it.
        learned: the clips that the model was learned from, in the order of its summary.
    """

    prepared: Prepared
    poses: Stage
    learned: tuple[Prepared, ...]
    model: Stage

    def film(self) -> PreparedClip:
        """The film, as it was prepared and as the learned head sees it."""
        from dubbing.preparation.head_findings import seen_by_head

        return seen_by_head(self.prepared.load(), self.poses.folder)

    def scale(self) -> LipScale:
        """The size of the lip measures of the model."""
        from dubbing.identity.lip_scale import LipScale

        return LipScale.of(self.model.folder, [one.load() for one in self.learned])

    def kept(self, clip: PreparedClip) -> np.ndarray:
        """Numbers (T,) of the reasons why frames of the film keep their own face."""
        import numpy as np

        from dubbing.identity.learned import learned
        from dubbing.video.own_pixels import learned_views, reasons

        parts = zip(self.learned, learned(self.model.folder), strict=True)
        views = [learned_views(of.load(), [*some, *turned]) for of, (_, some, turned) in parts]
        return reasons(clip, np.concatenate(views))


@dataclass(frozen=True, kw_only=True)
class OnFilm(DubbingStage):
    """A stage that puts heads onto the film of a dub.

    Attributes:
        people: by name.
        length, first, on_longer_audio: frames of the film under the dub; see `Dub`.
        consent: who agreed. No pixel depends on it, but a result records it.
    """

    film: Path
    sound: Sound
    people: Mapping[str, PersonOnFilm]
    length: int
    first: int
    on_longer_audio: str
    settings: VideoSettings
    consent: Any

    @staticmethod
    def common(dub: Dub, people: Mapping[str, PersonOnFilm]) -> dict[str, Any]:
        """The fields of a dub, but for its settings."""
        return {
            "film": dub.film.path,
            "sound": dub.sound,
            "people": people,
            "length": dub.length,
            "first": dub.first,
            "on_longer_audio": dub.on_longer_audio,
            "consent": dub.consent(),
        }

    def poses(self, clips: Mapping[str, PreparedClip]) -> np.ndarray:
        """Frame of the film under every frame of the dub, (F,)."""
        from dubbing.script import timeline

        segment = next(iter(clips.values())).segment
        return timeline.pose_index(self.length, segment, self.first, self.on_longer_audio)

    def amount(self) -> float:
        return self.length


@dataclass(frozen=True, kw_only=True)
class Composite(OnFilm):
    """Makes the video; see `dubbing.video.assembly`.

    Attributes:
        heads: the stages that rendered them, by cue.
        film_mouth: of edits of cues; see `Edit`.
    """

    heads: Mapping[str, Stage]
    mark: Marking | None
    film_mouth: Mapping[str, tuple[tuple[float, float], ...]]

    typical: ClassVar[Rate] = Rate(0.04, 3e3)

    @classmethod
    def of(cls, dub: Dub, heads: Mapping[str, Stage], people: Mapping[str, PersonOnFilm]) -> Self:
        """The stage for a dub."""
        common = cls.common(dub, people)
        spans = {cue.name: cue.edit.film_mouth for cue in dub.cues if cue.edit.film_mouth}
        settings, mark = dub.settings, dub.marking()
        return cls(**common, settings=settings, heads=heads, mark=mark, film_mouth=spans)

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.engine.disk.files import digest_data
        from dubbing.video.assembly import make
        from dubbing.video.heads import read_heads

        clips = {name: person.film() for name, person in self.people.items()}
        kept = {name: person.kept(clips[name]) for name, person in self.people.items()}
        poses = self.poses(clips)
        heads = []
        for cue in self.sound.cues:
            rendered = self.heads[cue.name]
            edit = Edit(film_mouth=self.film_mouth.get(cue.name, ()))
            own = heads_of(cue, edit, partial(read_heads, rendered.folder), clips, kept)
            heads.append(replace(own, made_of=partial(digests_of_heads, rendered)))
        settings = replace(self.settings, mark=self.mark)
        whole = [self.version, self.parameters["settings"], self.parameters["mark"]]
        whole += [digest_of(self.film)]
        whole += [person.prepared.stage.result() for person in self.people.values()]
        whole += [person.poses.result() for person in self.people.values()]
        make(
            heads,
            self.sound,
            out,
            pose_index=poses,
            settings=settings,
            progress=progress,
            made_by=digest_data(whole),
            last=self.last,
        )


def digests_of_heads(stage: Stage, first: int, count: int) -> list[str]:
    """Of heads first .. first + count of a rendering stage, what each is made of."""
    from dubbing.engine.disk.pieces import digests_of
    from dubbing.video.heads import files_of_heads

    found = []
    for start, path in files_of_heads(stage.folder, first, count):
        each = digests_of(stage.folder, path.name)
        found += each[max(0, first - start) : first + count - start] or [digest_of(path)]
    return found


def heads_of(
    cue: Cue,
    edit: Edit,
    read: Callable[[int, int], Iterator[np.ndarray]],
    clips: Mapping[str, PreparedClip],
    kept: Mapping[str, np.ndarray],
) -> Heads:
    """The heads of a cue, over the film of its person."""
    from dubbing.video.heads import Heads

    person = cue.identity
    clip, asked = clips[person], edit.of_film(cue.stop - cue.first, clips[person].rate)
    return Heads(read, clip, cue.first, cue.stop, kept[person], cue.name, asked)
