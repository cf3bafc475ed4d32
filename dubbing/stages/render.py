"""The stage `render`: the head of a person for every frame of a cue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dfrf.config import family
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.script import timeline
from dubbing.script.edit import Edit
from dubbing.stages.base import DubbingStage, Prepared

if TYPE_CHECKING:
    from dubbing.production.dub import Dub
    from dubbing.script.timeline import Cue

PART = 250  # frames that are rendered on one machine: a multiple of every method's segment
# Of a frame at 512 px on two processor cores. Preset `paper`: 744 s without the noise of its slots,
# times 1.55, the cost of that noise on 256 rays.
PAPER_FRAME_SECONDS = 1150.0
FRAME_SECONDS = {"paper": PAPER_FRAME_SECONDS, "marched": 0.32}


@dataclass(frozen=True, kw_only=True)
class Render(DubbingStage):
    """Renders heads; see `dubbing.heads.rendering`.

    Attributes:
        poses: the stage that refined them.
        speech: the stage that made the speech features of the cue.
        first, stop: frames of the cue in the dub.
        film_first, on_longer_audio: frames of the film under the dub; see `timeline.pose_index`.
        baked: whether heads are rendered off the model's baked density; False for a preset without.
        edit: of the cue's line.
        learned: the clips that the model was learned from, where the edit is of its lips.
        crop: area of the head crop as a share of a full one.
        part: first and stop of those of the cue's frames that are rendered; None for all.
    """

    model: Stage
    prepared: Prepared
    poses: Stage
    speech: Stage
    first: int
    stop: int
    film_first: int
    on_longer_audio: str
    baked: bool
    edit: Edit
    learned: tuple[Prepared, ...]
    preset: Setting[str]  # part of the model
    crop: Setting[float]
    device: Setting[str]
    part: Setting[tuple[int, int] | None] = None

    typical: ClassVar[Rate] = Rate(0.05, 15e3)

    @classmethod
    def of(
        cls,
        dub: Dub,
        cue: Cue,
        prepared: Prepared,
        model: Stage,
        poses: Stage,
        speech: Stage,
        learned: tuple[Prepared, ...],
        device: str,
    ) -> Self:
        """The stage for a cue of a dub."""
        person = dub.person(cue)
        return cls(
            model=model,
            prepared=prepared,
            poses=poses,
            speech=speech,
            first=cue.first,
            stop=cue.stop,
            film_first=dub.first,
            on_longer_audio=dub.on_longer_audio,
            baked=dub.baked and family(person.settings.preset) == "fast",
            edit=replace(cue.edit, film_mouth=()),
            learned=learned if cue.edit.of_lips else (),
            preset=person.settings.preset,
            crop=person.crops(dub.film),
            device=device,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.engine.disk.files import digest_data
        from dubbing.heads.rendering import render
        from dubbing.identity.learned import MODEL_FILE
        from dubbing.identity.lip_scale import LipScale, given_lips
        from dubbing.preparation.head_findings import seen_by_head
        from dubbing.sound_to_lips.cue_speech import Speech

        speech = Speech.load(self.speech.folder).styled(self.edit.style)
        clip = seen_by_head(self.prepared.load(), self.poses.folder)
        poses = timeline.pose_index(self.stop, clip.segment, self.film_first, self.on_longer_audio)
        frames = self.stop - self.first
        heard = self.edit.heard(frames, speech.rate)

        def scale() -> LipScale:
            return LipScale.of(self.model.folder, [one.load() for one in self.learned])

        render(
            self.model.folder / MODEL_FILE,
            clip,
            lambda first, count: speech.at(heard[first : first + count]),
            out,
            pose_index=poses[self.first :],
            part=self.part,
            baked=self.baked,
            strength=self.edit.strengths(frames, speech.rate),
            lips=given_lips(self.edit, frames, speech.rate, scale),
            scale=scale if self.learned else None,
            device=self.device,
            progress=progress,
            made_by=digest_data([self.version, digest_of(self.model.folder / MODEL_FILE)]),
            last=self.last,
        )

    def amount(self) -> float:
        first, stop = self.part or (self.first, self.stop)
        return (stop - first) * self.crop

    def parts(self) -> Mapping[str, Self]:
        """Ranges of `PART` frames, where there are several."""
        count = self.stop - self.first
        ranges = [(k, min(k + PART, count)) for k in range(0, count, PART)]
        if len(ranges) < 2:
            return {}
        return {f"{first}-{stop}": replace(self, part=(first, stop)) for first, stop in ranges}

    def rate_kind(self) -> str:
        return f"{self.kind} {self._how}" if self._how in FRAME_SECONDS else self.kind

    def typical_rate(self) -> Rate:
        return Rate(FRAME_SECONDS.get(self._how, self.typical.seconds), self.typical.bytes)

    @property
    def _how(self) -> str:
        """The kind of rendering, on which the time of a frame depends."""
        if family(self.preset) == "paper":
            return "paper"
        return "baked" if self.baked else "marched"
