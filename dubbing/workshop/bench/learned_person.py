"""A person of a manifest who was learned before: clip, speech, and model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dubbing.errors import ExplainedError
from dubbing.heads.fine_tuning import clip_speech
from dubbing.identity.learned import MODEL_FILE
from dubbing.manifest.manifest import load
from dubbing.pipeline import person_job
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.stages.check_source import CheckSource
from dubbing.stages.finetune import Finetune
from dubbing.stages.prepare import Prepare
from dubbing.sync.records import offset_of


@dataclass(frozen=True)
class LearnedPerson:
    """A prepared clip, its own speech, and the file of the model."""

    clip: PreparedClip
    speech: SpeechFrames
    model: Path

    @classmethod
    def of(cls, manifest: Path, name: str) -> Self:
        """A person of a manifest.

        Raises:
            ExplainedError: there is nobody of that name, or the clip was not prepared.
        """
        production = load(manifest)
        if name not in production.people:
            there = f"there is {', '.join(production.people)}"
            raise ExplainedError(f"no identity {name!r}", str(manifest), there)
        person = production.people[name]
        job = person_job(person, production.work)
        clip = PreparedClip.load(job.stage(Prepare).folder, person.clip.path)
        offset = offset_of(job.stage(CheckSource).folder)
        speech = clip_speech(clip, person.settings.speech, person.settings.weights, offset)
        return cls(clip, speech, job.stage(Finetune).folder / MODEL_FILE)
