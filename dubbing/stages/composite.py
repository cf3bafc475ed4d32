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
from dubbing.stages.base import DubbingStage, Prepared
from dubbing.video.settings import VideoSettings

if TYPE_CHECKING:
    import numpy as np

    from dubbing.identity.lip_scale import LipScale
    from dubbing.preparation.prepared import PreparedClip
    from dubbing.production.dub import Dub
    from dubbing.script.timeline import Cue
    from dubbing.video.composer import Heads


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
    """

    heads: Mapping[str, Stage]
    mark: Marking | None

    typical: ClassVar[Rate] = Rate(0.04, 3e3)

    @classmethod
    def of(cls, dub: Dub, heads: Mapping[str, Stage], people: Mapping[str, PersonOnFilm]) -> Self:
        """The stage for a dub."""
        common = cls.common(dub, people)
        return cls(**common, settings=dub.settings, heads=heads, mark=dub.marking())

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.engine.disk.files import digest_data
        from dubbing.video.assembly import make
        from dubbing.video.composer import read_heads

        clips = {name: person.film() for name, person in self.people.items()}
        kept = {name: person.kept(clips[name]) for name, person in self.people.items()}
        poses = self.poses(clips)
        heads = [
            replace(
                heads_of(cue, partial(read_heads, self.heads[cue.name].folder), clips, kept),
                made_of=partial(digests_of_heads, self.heads[cue.name]),
            )
            for cue in self.sound.cues
        ]
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
    """Digests of the files that hold heads first .. first + count of a rendering stage."""
    from dubbing.video.composer import files_of_heads

    return [digest_of(path) for _, path in files_of_heads(stage.folder, first, count)]


def heads_of(
    cue: Cue,
    read: Callable[[int, int], Iterator[np.ndarray]],
    clips: Mapping[str, PreparedClip],
    kept: Mapping[str, np.ndarray],
) -> Heads:
    """The heads of a cue, over the film of its person."""
    from dubbing.video.composer import Heads

    person = cue.identity
    return Heads(read, clips[person], cue.first, cue.stop, kept[person], cue.name)
